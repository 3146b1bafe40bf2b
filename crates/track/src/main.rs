//! The program of `thirdbounce track`; see `program`.

fn main() -> std::process::ExitCode {
    thirdbounce_track::program::main()
}

//! The program of `thirdbounce histogram`; see `program`.

fn main() -> std::process::ExitCode {
    thirdbounce_tags::program::main()
}

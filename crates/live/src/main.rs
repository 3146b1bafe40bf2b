//! The program of `thirdbounce live`; see `arguments`.

fn main() -> std::process::ExitCode {
    thirdbounce_live::main()
}

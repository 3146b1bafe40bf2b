//! The command; see `cli`.

fn main() -> std::process::ExitCode {
    thirdbounce_command::cli::main()
}

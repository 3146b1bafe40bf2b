//! The program of `thirdbounce benchmark`; see `arguments`.

fn main() -> std::process::ExitCode {
    thirdbounce_benchmark::main()
}

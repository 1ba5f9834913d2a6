//! The command `pathloom`.

mod command;

fn main() -> std::process::ExitCode {
    // Mesa's device selection layer looks for a Wayland compositor and, without one, prints an error that means nothing here;
    // adapters are chosen by `--adapter`.
    // SAFETY: no other thread runs yet.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    command::main()
}

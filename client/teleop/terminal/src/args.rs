//! Options of `wheelarm teleop`.

use std::net::SocketAddr;

use clap::Args;

use wheelarm_options::choice;

/// Options of `wheelarm teleop`.
#[derive(Args, Clone, Debug)]
pub struct TeleopArgs {
    /// Name under which you command; other users see it.
    #[arg(long, default_value_t = choice::own_name("teleop"), value_parser = choice::name, value_name = "NAME")]
    pub commander: String,
    /// Takes control from its current holder.
    #[arg(long, alias = "force")]
    pub take: bool,
    /// Label of the first episode; from task and seed when absent.
    #[arg(long)]
    pub label: Option<String>,
    /// Instruction of the first episode; the scenario's when absent.
    #[arg(long)]
    pub instruction: Option<String>,
    /// Recorders that must be ready when an episode starts; 0 is practice: nothing is
    /// recorded.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub require_recorders: u32,
    /// Keeps the hand within WheelArm-Sim's reach shell: 0.41 to 0.873 m
    /// around the shoulder.
    #[arg(long)]
    pub reach_shell: bool,
    /// The chair stops this many seconds after its last key; without it a
    /// direction stays until k.
    #[arg(long, value_name = "SECONDS", value_parser = dead_man)]
    pub dead_man: Option<f64>,
    /// Shows the position of the task's object (ground truth).
    #[arg(long)]
    pub target_hint: bool,
    /// Address of the preview page; another port is used when it is taken.
    #[arg(long, default_value = wheelarm_teleop_web::preview::DEFAULT_ADDRESS, value_name = "ADDRESS:PORT")]
    pub page: SocketAddr,
    /// Starts no preview page.
    #[arg(long)]
    pub no_page: bool,
}

fn dead_man(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|s: &f64| (0.3..=60.0).contains(s))
        .ok_or_else(|| format!("{text:?} is not a number of seconds from 0.3 to 60"))
}

//! Log lines: to standard error as ROS writes them, and to `/rosout`. What rustdds and ros2-client log through
//! the `log` crate is not collected at all: they call ordinary discovery an error.

use crate::Stamp;
use crate::args::LogOptions;
use puffer_msgs::rcl_interfaces::msg::Log;
use std::fmt::Write as _;
use std::sync::{OnceLock, PoisonError, RwLock};
use tokio::sync::mpsc::UnboundedSender;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Metadata, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};

/// The nodes of this process.
static NODES: RwLock<Vec<NodeLog>> = RwLock::new(Vec::new());
static INSTALLED: OnceLock<()> = OnceLock::new();

/// A node's share in the log.
struct NodeLog {
    number: u64,
    /// As in "/cell/nbv_planner", with dots, as rcl names loggers: "cell.nbv_planner".
    logger: String,
    /// Name of the crate whose lines are this node's: the name that the program gave it.
    crate_name: String,
    level: Level,
    stderr: bool,
    rosout: Option<UnboundedSender<Log>>,
    clock: Box<dyn Fn() -> Stamp + Send + Sync>,
}

/// Takes the node out of the log when dropped.
pub(crate) struct Registration(u64);

impl Drop for Registration {
    fn drop(&mut self) {
        let mut nodes = NODES.write().unwrap_or_else(PoisonError::into_inner);
        nodes.retain(|node| node.number != self.0);
    }
}

pub(crate) fn register(
    full_name: &str,
    crate_name: &str,
    options: &LogOptions,
    rosout: UnboundedSender<Log>,
    clock: impl Fn() -> Stamp + Send + Sync + 'static,
) -> Registration {
    INSTALLED.get_or_init(|| {
        let subscriber = tracing_subscriber::registry().with(Lines);
        // A program that has a subscriber of its own keeps it, and has no /rosout.
        let _ = tracing::subscriber::set_global_default(subscriber);
    });
    let mut nodes = NODES.write().unwrap_or_else(PoisonError::into_inner);
    let number = nodes.last().map_or(0, |node| node.number + 1);
    nodes.push(NodeLog {
        number,
        logger: full_name.trim_start_matches('/').replace('/', "."),
        crate_name: crate_name.to_owned(),
        level: level(&options.level),
        stderr: options.stdout,
        rosout: options.rosout.then_some(rosout),
        clock: Box::new(clock),
    });
    tracing::callsite::rebuild_interest_cache();
    Registration(number)
}

fn level(name: &str) -> Level {
    match name {
        "debug" => Level::DEBUG,
        "warn" => Level::WARN,
        "error" | "fatal" => Level::ERROR,
        _ => Level::INFO,
    }
}

struct Lines;

impl<S: Subscriber> Layer<S> for Lines {
    fn enabled(&self, metadata: &Metadata<'_>, _: Context<'_, S>) -> bool {
        metadata.is_event() && *metadata.level() <= Level::DEBUG
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut text = Text::default();
        event.record(&mut text);
        let nodes = NODES.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(node) = owner(&nodes, event.metadata(), text.node.as_deref())
            && *event.metadata().level() <= node.level
        {
            emit(node, event.metadata(), text.message);
        }
    }
}

/// The node that a line belongs to: the one it names (field `node`), else the one of the crate that wrote it,
/// else the first.
fn owner<'a>(nodes: &'a [NodeLog], of: &Metadata<'_>, named: Option<&str>) -> Option<&'a NodeLog> {
    let crate_name = of.target().split("::").next().unwrap_or_default();
    let by_name = named.and_then(|name| nodes.iter().find(|node| node.logger == name));
    by_name
        .or_else(|| nodes.iter().find(|node| node.crate_name == crate_name))
        .or_else(|| nodes.first())
}

fn emit(node: &NodeLog, metadata: &Metadata<'_>, message: String) {
    let stamp = (node.clock)();
    let (word, severity) = match *metadata.level() {
        Level::ERROR => ("ERROR", Log::ERROR),
        Level::WARN => ("WARN", Log::WARN),
        Level::INFO => ("INFO", Log::INFO),
        _ => ("DEBUG", Log::DEBUG),
    };
    if node.stderr {
        eprintln!("[{word}] [{stamp}] [{}]: {message}", node.logger);
    }
    if let Some(rosout) = &node.rosout {
        // Fails only while the node ends.
        let _ = rosout.send(Log {
            stamp: stamp.into(),
            level: severity,
            name: node.logger.clone(),
            msg: message,
            file: metadata.file().unwrap_or_default().to_owned(),
            function: metadata.target().to_owned(),
            line: metadata.line().unwrap_or_default(),
        });
    }
}

#[derive(Default)]
struct Text {
    message: String,
    node: Option<String>,
}

impl Visit for Text {
    fn record_str(&mut self, field: &Field, value: &str) {
        match field.name() {
            "node" => self.node = Some(value.trim_start_matches('/').replace('/', ".")),
            "message" => self.message.insert_str(0, value),
            name => {
                let _ = write!(self.message, " {name}={value}");
            }
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        self.record_str(field, &format!("{value:?}"));
    }
}

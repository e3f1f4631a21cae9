//! Log lines: they go to standard error as ROS 2 writes them, and to `/rosout`. What rustdds 0.15.1
//! and ros2-client log through the `log` crate is not collected at all: they log ordinary discovery
//! as errors.

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
/// Set once this process collects log lines.
static INSTALLED: OnceLock<()> = OnceLock::new();

/// How the lines of one node are logged.
struct NodeLog {
    number: u64,
    /// Name of the logger, which is the node's full name with dots, as in rcl: "cell.nbv_planner".
    logger: String,
    /// Name of the crate whose lines are this node's: the node's default name.
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

/// Logs the lines of a node until what is returned is dropped; `rosout` gets the messages for
/// `/rosout`.
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
        level: level_from_name(&options.level),
        stderr: options.stdout,
        rosout: options.rosout.then_some(rosout),
        clock: Box::new(clock),
    });
    tracing::callsite::rebuild_interest_cache();
    Registration(number)
}

/// The level of a ROS 2 log option.
fn level_from_name(name: &str) -> Level {
    match name {
        "debug" => Level::DEBUG,
        "warn" => Level::WARN,
        "error" | "fatal" => Level::ERROR,
        _ => Level::INFO,
    }
}

/// Hands log lines to the nodes that they belong to.
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

/// The node that a line belongs to: the one that the line names (field `node`), else the one of the
/// crate that logged it, else the first.
fn owner<'a>(nodes: &'a [NodeLog], of: &Metadata<'_>, named: Option<&str>) -> Option<&'a NodeLog> {
    let crate_name = of.target().split("::").next().unwrap_or_default();
    let by_name = named.and_then(|name| nodes.iter().find(|node| node.logger == name));
    by_name
        .or_else(|| nodes.iter().find(|node| node.crate_name == crate_name))
        .or_else(|| nodes.first())
}

/// Writes a line to standard error and sends it to `/rosout`.
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

/// The text of a line, and the node that it names.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn node(number: u64, logger: &str, crate_name: &str) -> NodeLog {
        NodeLog {
            number,
            logger: logger.to_owned(),
            crate_name: crate_name.to_owned(),
            level: Level::INFO,
            stderr: false,
            rosout: None,
            clock: Box::new(|| Stamp::ZERO),
        }
    }

    /// The numbers of the nodes that log lines belong to, by the node that the line names.
    struct Owners(RwLock<Vec<Option<u64>>>);

    impl<S: Subscriber> Layer<S> for &'static Owners {
        fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
            let nodes = [node(5, "cell.first", "other"), node(6, "cell.second", "puffer_ros")];
            let mut text = Text::default();
            event.record(&mut text);
            let owner = owner(&nodes, event.metadata(), text.node.as_deref());
            self.0.write().unwrap().push(owner.map(|node| node.number));
        }
    }

    #[test]
    fn a_line_belongs_to_the_node_that_it_names_or_else_to_that_of_its_crate() {
        static OWNERS: Owners = Owners(RwLock::new(Vec::new()));
        let subscriber = tracing_subscriber::registry().with(&OWNERS);
        tracing::subscriber::with_default(subscriber, || {
            tracing::info!(node = "/cell/first", "named");
            tracing::info!("of this crate");
            tracing::info!(node = "/nobody", "an unknown node");
            tracing::info!(target: "foreign::module", "of another crate");
        });
        assert_eq!(*OWNERS.0.read().unwrap(), [Some(5), Some(6), Some(6), Some(5)]);
    }

    #[test]
    fn levels_are_those_of_ros() {
        for (name, level) in [
            ("debug", Level::DEBUG),
            ("info", Level::INFO),
            ("warn", Level::WARN),
            ("error", Level::ERROR),
            ("fatal", Level::ERROR),
        ] {
            assert_eq!(level_from_name(name), level);
        }
    }
}

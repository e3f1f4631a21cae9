//! The values of a node's parameters: its own, and `use_sim_time`.

use crate::args::Setting;
use anyhow::{Result, bail};
use puffer_core::params::{ParamSpec, Parameters};
use serde_json::Value;
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};
use tokio::sync::watch;

/// Name of the parameter that every ROS 2 node has.
pub(crate) const USE_SIM_TIME: &str = "use_sim_time";

/// The values of the parameters `P` and of `use_sim_time`; waiting tasks are told of changes.
pub(crate) struct ParameterStore<P> {
    values: watch::Sender<P>,
    sim_time: watch::Sender<bool>,
    read_only: Mutex<BTreeSet<String>>,
}

impl<P: Parameters> ParameterStore<P> {
    /// The default values, overridden by what `settings` say for the node `full`: first what is
    /// said for a pattern of nodes, then what is said for the node itself; later ones win.
    pub fn new(full: &str, settings: &[Setting]) -> Result<Self> {
        let store = Self {
            values: watch::Sender::new(P::default()),
            sim_time: watch::Sender::new(false),
            read_only: Mutex::default(),
        };
        let mine = settings.iter().filter(|s| s.applies_to(full) && !is_of_rclcpp(&s.name));
        for exact in [false, true] {
            for setting in mine.clone().filter(|s| s.is_meant_exactly() == exact) {
                let known = Self::specs().iter().any(|spec| spec.name == setting.name);
                if !known && !exact {
                    continue;
                }
                if let Err(reason) = store.set(&[(setting.name.clone(), setting.value.clone())]) {
                    bail!("{full}: {reason} (from {})", setting.origin);
                }
            }
        }
        Ok(store)
    }

    /// The specifications of all parameters.
    pub fn specs() -> Vec<ParamSpec> {
        let mut specs = P::all_specs();
        specs.push(ParamSpec {
            name: USE_SIM_TIME.to_owned(),
            kind: "boolean",
            default: Value::from(false),
            range: None,
            choices: &[],
            unit: "",
            description: "Whether time comes from /clock.".to_owned(),
        });
        specs
    }

    /// The values of all parameters, by name.
    pub fn values(&self) -> Vec<(String, Value)> {
        let mut values = self.values.borrow().all_values();
        values.push((USE_SIM_TIME.to_owned(), Value::from(*self.sim_time.borrow())));
        values
    }

    /// The values of the node's own parameters.
    pub fn params(&self) -> P {
        self.values.borrow().clone()
    }

    /// Resolves when the values differ from `seen`.
    pub async fn changed(&self, seen: &P) -> P {
        let seen = seen.all_values();
        let mut values = self.values.subscribe();
        match values.wait_for(|now| now.all_values() != seen).await {
            Ok(now) => now.clone(),
            // Never: `self` holds the sender.
            Err(_) => std::future::pending().await,
        }
    }

    /// A receiver of the value of `use_sim_time`.
    pub fn watch_sim_time(&self) -> watch::Receiver<bool> {
        self.sim_time.subscribe()
    }

    /// Makes parameters read-only.
    pub fn protect(&self, names: &[&str]) {
        let mut read_only = self.read_only.lock().unwrap_or_else(PoisonError::into_inner);
        read_only.extend(names.iter().map(|&name| name.to_owned()));
    }

    pub fn is_read_only(&self, name: &str) -> bool {
        self.read_only.lock().unwrap_or_else(PoisonError::into_inner).contains(name)
    }

    /// Sets all of the parameters or none.
    ///
    /// # Errors
    /// In words, if a parameter is unknown, read-only, or its value not allowed.
    pub fn set(&self, changes: &[(String, Value)]) -> Result<(), String> {
        let mut outcome = Ok(());
        let mut sim_time = None;
        self.values.send_if_modified(|current| {
            let mut next = current.clone();
            outcome = changes
                .iter()
                .try_for_each(|(name, value)| self.set_one(&mut next, &mut sim_time, name, value));
            if outcome.is_ok() {
                *current = next;
            }
            outcome.is_ok()
        });
        outcome?;
        if let Some(on) = sim_time {
            self.sim_time.send_replace(on);
        }
        Ok(())
    }

    fn set_one(
        &self,
        params: &mut P,
        sim_time: &mut Option<bool>,
        name: &str,
        value: &Value,
    ) -> Result<(), String> {
        if self.is_read_only(name) {
            return Err(format!(
                "parameter {name}: read-only while the node runs; restart it with -p {name}:=..."
            ));
        }
        if name == USE_SIM_TIME {
            *sim_time = Some(
                value
                    .as_bool()
                    .ok_or_else(|| format!("parameter {name}: {value} is not of type boolean"))?,
            );
            return Ok(());
        }
        let (group, field) = name.rsplit_once('.').ok_or_else(|| {
            let known: Vec<_> = Self::specs().into_iter().map(|spec| spec.name).collect();
            format!("parameter {name}: unknown; this node has {}", known.join(", "))
        })?;
        params.set_named(group, field, value).map_err(|error| error.to_string())
    }
}

/// Whether a parameter is one of rclcpp's own, which have no meaning here.
fn is_of_rclcpp(name: &str) -> bool {
    name.starts_with("qos_overrides.") || name == "start_type_description_service"
}

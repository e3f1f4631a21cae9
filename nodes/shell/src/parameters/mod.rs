//! A node's parameters: start values, changes by service, and who is told.

mod services;
mod values;

use crate::args::Setting;
use crate::clock::Clock;
use anyhow::{Result, bail};
use puffer_core::params::Parameters;
use puffer_msgs::rcl_interfaces::msg::Parameter;
use serde_json::Value;
pub(crate) use services::serve;
use tokio::sync::watch;

/// A parameter of every ROS node: whether time comes from `/clock`.
const USE_SIM_TIME: &str = "use_sim_time";

/// The parameters of one node.
pub(crate) struct Store<P> {
    values: watch::Sender<P>,
    clock: Clock,
}

impl<P: Parameters> Store<P> {
    /// Defaults, then what `settings` say for the node `full`: patterns first, then what names this very node;
    /// later ones win.
    pub fn new(full: &str, settings: &[Setting], clock: Clock) -> Result<Self> {
        let mut values = P::default();
        let mine: Vec<_> = settings.iter().filter(|setting| setting.applies_to(full)).collect();
        for exact in [false, true] {
            for setting in mine.iter().filter(|s| s.is_meant_exactly() == exact) {
                if !exact && !is_known::<P>(&setting.name) {
                    continue;
                }
                if let Err(reason) = apply(&mut values, &clock, &setting.name, &setting.value) {
                    bail!("node {full}, {}: {reason}", setting.origin);
                }
            }
        }
        Ok(Self { values: watch::Sender::new(values), clock })
    }

    pub fn get(&self) -> P {
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

    /// All names with their values, `use_sim_time` first.
    fn all(&self) -> Vec<(String, Value)> {
        let mut all = vec![(USE_SIM_TIME.to_owned(), Value::from(self.clock.is_simulated()))];
        all.extend(self.values.borrow().all_values());
        all
    }

    fn value(&self, name: &str) -> Option<Value> {
        self.all().into_iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }

    /// Sets all of `parameters` or none.
    fn set(&self, parameters: &[Parameter]) -> Result<(), String> {
        // Locked for the whole change: two callers must not undo each other.
        let mut outcome = Ok(());
        self.values.send_if_modified(|values| {
            let mut next = values.clone();
            let trial = Clock::new();
            trial.simulate(self.clock.is_simulated());
            for parameter in parameters {
                let value = match values::to_json(&parameter.value) {
                    Ok(value) => value,
                    Err(error) => {
                        outcome = Err(format!("{}: {error}", parameter.name));
                        return false;
                    }
                };
                if let Err(error) = apply(&mut next, &trial, &parameter.name, &value) {
                    outcome = Err(error);
                    return false;
                }
            }
            self.clock.simulate(trial.is_simulated());
            let changed = next.all_values() != values.all_values();
            *values = next;
            changed
        });
        outcome
    }
}

fn is_known<P: Parameters>(name: &str) -> bool {
    name == USE_SIM_TIME || P::all_specs().iter().any(|spec| spec.name == name)
}

fn apply<P: Parameters>(
    values: &mut P,
    clock: &Clock,
    name: &str,
    value: &Value,
) -> Result<(), String> {
    if name == USE_SIM_TIME {
        let on = value.as_bool().ok_or(format!("{name}: {value} is not true or false"))?;
        clock.simulate(on);
        return Ok(());
    }
    let (group, field) = name.split_once('.').ok_or_else(|| {
        format!(
            "parameter `{name}` is unknown; this node's are named group.field: {}",
            known::<P>()
        )
    })?;
    if !is_known::<P>(name) {
        return Err(format!("parameter `{name}` is unknown; this node has {}", known::<P>()));
    }
    values.set_named(group, field, value).map_err(|error| error.to_string())
}

fn known<P: Parameters>() -> String {
    let names = P::all_specs().into_iter().map(|spec| spec.name);
    std::iter::once(USE_SIM_TIME.to_owned()).chain(names).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests;

//! All files of all packages, and what only the whole shows: unknown types, circles, facts of
//! nested messages.

use crate::interface_error::{Error, Result};
use crate::model::{Base, Count, Interface, Kind, MessageName, Part};
use crate::{Package, file_syntax, type_syntax};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The interfaces, sorted by package, kind and name.
pub(crate) struct InterfaceTree {
    pub interfaces: Vec<Interface>,
    messages: BTreeMap<MessageName, usize>,
}

/// Reads and checks all packages.
pub(crate) fn read(packages: &[Package]) -> Result<InterfaceTree> {
    let mut interfaces = Vec::new();
    for package in packages {
        type_syntax::package_name(&package.name).map_err(|e| Error::file(&package.folder, e))?;
        for kind in Kind::ALL {
            for path in files(&package.folder.join(kind.name()), kind)? {
                interfaces.push(read_interface(&package.name, kind, path)?);
            }
        }
    }
    interfaces.sort_by_key(|i| (i.package.clone(), i.kind, i.name.clone()));
    let tree = InterfaceTree { messages: index(&interfaces)?, interfaces };
    tree.check_names()?;
    tree.check_circles()?;
    Ok(tree)
}

/// The files of a folder in order; a package need not have every folder.
fn files(folder: &Path, kind: Kind) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| read_error(folder, &e))? {
        let path = entry.map_err(|e| read_error(folder, &e))?.path();
        if path.extension().is_none_or(|ending| ending != kind.name()) {
            let message = format!("only .{} files belong in this folder", kind.name());
            return Err(Error::file(&path, message));
        }
        paths.push(path);
    }
    paths.sort();
    Ok(paths)
}

fn read_error(folder: &Path, error: &std::io::Error) -> Error {
    Error::file(folder, format!("cannot be read: {error}"))
}

/// Reads one file.
fn read_interface(package: &str, kind: Kind, path: PathBuf) -> Result<Interface> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    type_syntax::interface_name(&name)
        .map_err(|e| Error::file(&path, format!("file name: {e}")))?;
    let text = fs::read_to_string(&path)
        .map_err(|e| Error::file(&path, format!("cannot be read as UTF-8 text: {e}")))?;
    let parts = file_syntax::read(&text, kind, package, &path)?;
    Ok(Interface { package: package.to_string(), name, kind, path, parts })
}

fn index(interfaces: &[Interface]) -> Result<BTreeMap<MessageName, usize>> {
    let mut messages = BTreeMap::new();
    for (at, interface) in interfaces.iter().enumerate() {
        if interface.kind != Kind::Msg {
            continue;
        }
        let name = MessageName { package: interface.package.clone(), name: interface.name.clone() };
        if messages.insert(name, at).is_some() {
            return Err(Error::file(&interface.path, "this message is defined twice"));
        }
    }
    Ok(messages)
}

impl InterfaceTree {
    /// The only part of a message.
    pub fn message(&self, name: &MessageName) -> Option<&Part> {
        self.interfaces.get(*self.messages.get(name)?)?.parts.first()
    }

    fn check_names(&self) -> Result<()> {
        for interface in &self.interfaces {
            for field in interface.parts.iter().flat_map(|part| &part.fields) {
                let Base::Message(name) = &field.kind.base else {
                    continue;
                };
                if self.message(name).is_none() {
                    let MessageName { package, name } = name;
                    let message = format!(
                        "there is no message {package}/{name}: mend the name, or write \
                         {package}/msg/{name}.msg"
                    );
                    return Err(Error::line(&interface.path, field.line, message));
                }
            }
        }
        Ok(())
    }

    fn check_circles(&self) -> Result<()> {
        let mut done = BTreeSet::new();
        for (name, at) in &self.messages {
            if self.is_circular(name, &mut Vec::new(), &mut done) {
                let message = "this message contains itself, which ROS 2 does not allow";
                return Err(Error::file(&self.interfaces[*at].path, message));
            }
        }
        Ok(())
    }

    fn is_circular<'a>(
        &'a self,
        name: &'a MessageName,
        above: &mut Vec<&'a MessageName>,
        done: &mut BTreeSet<&'a MessageName>,
    ) -> bool {
        if above.contains(&name) {
            return true;
        }
        if done.contains(name) {
            return false;
        }
        above.push(name);
        let circular = self.message(name).is_some_and(|part| {
            nested(part).into_iter().any(|inner| self.is_circular(inner, above, done))
        });
        above.pop();
        done.insert(name);
        circular
    }

    /// Whether a floating-point number is somewhere inside.
    pub fn has_float(&self, part: &Part) -> bool {
        part.fields.iter().any(|field| match &field.kind.base {
            Base::Primitive(primitive) => primitive.is_float(),
            Base::Text { .. } => false,
            Base::Message(name) => self.message(name).is_some_and(|inner| self.has_float(inner)),
        })
    }

    /// Octets in memory if all fields have a fixed size, without padding.
    pub fn fixed_size(&self, part: &Part) -> Option<usize> {
        let sizes = part.fields.iter().map(|field| {
            let one = match &field.kind.base {
                Base::Primitive(primitive) => primitive.size(),
                Base::Text { .. } => return None,
                Base::Message(name) => self.fixed_size(self.message(name)?)?,
            };
            match field.kind.count {
                Count::One => Some(one),
                Count::Fixed(n) => Some(n * one),
                Count::Sequence { .. } => None,
            }
        });
        sizes.sum()
    }
}

/// The messages that a part names, in order.
pub(crate) fn nested(part: &Part) -> Vec<&MessageName> {
    let names = part.fields.iter().filter_map(|field| match &field.kind.base {
        Base::Message(name) => Some(name),
        Base::Primitive(_) | Base::Text { .. } => None,
    });
    names.collect()
}

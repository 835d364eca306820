//! Shapes of several shapes: `merge`, and `instance` of a `shapegroup`.
//!
//! Ours: instances are copies. Mitsuba keeps one tree a group; here each of a group's triangles is in the scene as often as the group is.

use super::Builder;
use crate::exchange::MAX_TRIANGLES;
use crate::exchange::mitsuba::params::Params;
use crate::exchange::mitsuba::tree::{Kind, MAX_DEPTH, Node, Param, Value};
use crate::{Error, Result};
use glam::DMat4;
use std::collections::BTreeMap;

/// Most shapes in groups, which could multiply without end by referring to groups.
pub(super) const MAX_SHAPES: usize = 1_000_000;

impl<'a> Builder<'a> {
    /// Adds a shape, or all shapes of a group.
    pub(super) fn shapes(&mut self, node: &'a Node) -> Result<()> {
        match node.plugin.as_str() {
            // Seen through its instances alone.
            "shapegroup" => Ok(()),
            "merge" => {
                let mut params = self.params(node);
                let parts = params.children(Kind::Shape)?;
                params.finish(&mut self.scene.warnings);
                self.each(node, &parts)
            }
            "instance" => self.instance(node),
            _ => self.shape(node),
        }
    }

    fn each(&mut self, node: &'a Node, parts: &[&'a Node]) -> Result<()> {
        if self.groups >= MAX_DEPTH {
            return Err(node.at.error(format!("shapes are nested more than {MAX_DEPTH} deep: do they refer to themselves?")));
        }
        self.groups += 1;
        let mut added = Vec::new();
        for part in parts {
            self.grouped += 1;
            if self.grouped > MAX_SHAPES || self.scene.geometry.triangles.len() > MAX_TRIANGLES {
                let most = format!("more than {MAX_SHAPES} shapes or {MAX_TRIANGLES} triangles in groups, which are copied");
                // Alone: the groups around this one stop at once, too.
                added = vec![Err(node.at.error(most))];
                break;
            }
            added.push(self.top_level_or_nothing(part));
        }
        self.groups -= 1;
        Error::gather(added).map(|_| ())
    }

    fn instance(&mut self, node: &'a Node) -> Result<()> {
        if self.instance.is_some() {
            return Err(node.at.error("an instance within an instance is not supported"));
        }
        let mut params = self.params(node);
        let group = match params.children(Kind::Shape)?.as_slice() {
            [group] if group.plugin == "shapegroup" => *group,
            found => return Err(node.at.error(format!("instance: found {} shapes, expected one shapegroup", found.len()))),
        };
        let to_world = params.transform("to_world")?;
        params.finish(&mut self.scene.warnings);
        let mut group_params = self.params(group);
        let parts = group_params.children(Kind::Shape)?;
        self.instance = Some(to_world);
        let added = self.each(node, &parts);
        self.instance = None;
        added
    }

    /// An error where the copies would be too many, before the first is made.
    pub(super) fn count_copies(&self, children: &'a [Param]) -> Result<()> {
        let mut sizes = BTreeMap::new();
        let (mut all, mut visited) = (0usize, 0);
        for child in children {
            let Value::Plugin(node) = &child.value else { continue };
            if node.plugin != "instance" {
                continue;
            }
            for group in self.params(node).children(Kind::Shape)? {
                let size = match sizes.get(&(group as *const Node)) {
                    Some(size) => *size,
                    None => self.triangles(group, 0, &mut visited)?,
                };
                sizes.insert(group as *const Node, size);
                all = all.saturating_add(size);
            }
            if all > MAX_TRIANGLES {
                let message = format!(
                    "with this instance the scene has {all} triangles, expected at most {MAX_TRIANGLES}: instances are copied"
                );
                return Err(node.at.error(message));
            }
        }
        Ok(())
    }

    /// Triangles of the files of a group.
    fn triangles(&self, node: &'a Node, depth: usize, visited: &mut usize) -> Result<usize> {
        *visited += 1;
        if *visited > MAX_SHAPES {
            return Err(node.at.error(format!("more than {MAX_SHAPES} shapes in groups")));
        }
        let own = self.assets.mesh(node).map_or(0, |mesh| mesh.triangles.len());
        let parts = if depth < MAX_DEPTH { self.params(node).children(Kind::Shape)? } else { Vec::new() };
        parts.into_iter().try_fold(own, |sum, part| Ok(sum.saturating_add(self.triangles(part, depth + 1, visited)?)))
    }

    /// `to_world` within the instance that is being added.
    pub(super) fn within_instance(&self, p: &mut Params<'a>) -> Result<DMat4> {
        Ok(self.instance.unwrap_or(DMat4::IDENTITY) * p.transform("to_world")?)
    }

    /// Whether the instance mirrors: unlike a shape's own transform, it takes the sides of a mesh with it.
    pub(super) fn instance_mirrors(&self) -> bool {
        self.instance.is_some_and(|m| m.determinant() < 0.0)
    }
}

//! The node hierarchy: checked to be a forest, and multiplied out in f64.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::json::Node;
use serde_json::Value;

use super::source::Source;
use crate::only::Choice;
use crate::{ErrorKind, ImportError, Report};

/// The nodes of a file.
pub(super) struct Nodes {
    /// From each node's space to the world.
    pub(super) world: Vec<DAffine3>,
    /// The nodes of the scene that is shown, parents before children, in the order of the file.
    pub(super) shown: Vec<usize>,
    /// Those of them whose meshes are wanted.
    pub(super) drawn: Vec<usize>,
}

impl Nodes {
    /// Multiplies out the hierarchy and finds what one scene shows, without a scene what hangs at any root. `value` is
    /// the file's JSON: the typed model has transforms only in f32.
    ///
    /// # Errors
    /// If a node has two parents or is its own descendant, or a transform makes no sense.
    pub(super) fn new(
        source: &Source<'_>,
        value: &Value,
        scene: Option<usize>,
        only: &[String],
        report: &mut Report,
    ) -> Result<Self, ImportError> {
        let nodes = &source.root.nodes;
        if nodes.len() as u64 > source.limits.instances {
            let cause = format!("{} nodes are more than the limit of {}", nodes.len(), source.limits.instances);
            return Err(source.at("/nodes", ErrorKind::Limit(cause)));
        }
        let parents = parents(source)?;
        let mut world = Vec::with_capacity(nodes.len());
        for (i, node) in nodes.iter().enumerate() {
            let json = value.get("nodes").and_then(|n| n.get(i)).unwrap_or(&Value::Null);
            world.push(local(source, i, node, json, report)?);
        }
        let roots = (0..nodes.len()).filter(|&i| parents[i].is_none()).collect();
        let order = descend(nodes, roots, |_| true);
        if order.len() < nodes.len() {
            let mut reached = vec![false; nodes.len()];
            order.iter().for_each(|&(i, _)| reached[i] = true);
            let lost = reached.iter().position(|r| !r).unwrap_or_default();
            return Err(source.invalid(format!("/nodes/{lost}"), "is its own ancestor or hangs below one that is"));
        }
        for &(i, depth) in &order {
            if depth > source.limits.depth {
                let cause = format!("is nested deeper than the limit of {}", source.limits.depth);
                return Err(source.at(format!("/nodes/{i}"), ErrorKind::Limit(cause)));
            }
            if let Some(parent) = parents[i] {
                world[i] = world[parent] * world[i];
            }
        }
        let shown = match scene {
            Some(scene) => descend(nodes, scene_roots(source, scene, &parents)?, visible),
            None => descend(nodes, (0..nodes.len()).filter(|&i| parents[i].is_none()).collect(), visible),
        };
        let shown: Vec<usize> = shown.into_iter().map(|(i, _)| i).collect();
        Ok(Self { drawn: drawn(source, &shown, only)?, world, shown })
    }
}

/// The nodes that are called so, with all below them, and those whose meshes are.
fn drawn(source: &Source<'_>, shown: &[usize], only: &[String]) -> Result<Vec<usize>, ImportError> {
    let Some(mut choice) = Choice::new(only) else { return Ok(shown.to_vec()) };
    let root = source.root;
    let mut whole = vec![false; root.nodes.len()];
    let mut drawn = Vec::new();
    // Parents come before their children.
    for &i in shown {
        let node = &root.nodes[i];
        let name = node.name.clone().unwrap_or_else(|| format!("node {i}"));
        whole[i] |= choice.takes([name.as_str()]);
        if whole[i] {
            node.children.iter().flatten().for_each(|child| whole[child.value()] = true);
        }
        let mesh =
            node.mesh.map(|m| root.meshes[m.value()].name.clone().unwrap_or_else(|| format!("mesh {}", m.value())));
        if choice.takes(mesh.as_deref()) || whole[i] {
            drawn.push(i);
        }
    }
    choice.finish(source.file)?;
    Ok(drawn)
}

/// The nodes below the roots, each with its depth, parents first. A stack of our own: files may nest deeper than
/// the thread's stack allows.
fn descend(nodes: &[Node], roots: Vec<usize>, enter: impl Fn(&Node) -> bool) -> Vec<(usize, u32)> {
    let mut order = Vec::with_capacity(nodes.len());
    let mut stack: Vec<(usize, u32)> = roots.into_iter().rev().map(|i| (i, 0)).collect();
    while let Some((i, depth)) = stack.pop() {
        if enter(&nodes[i]) {
            order.push((i, depth));
            stack.extend(nodes[i].children.iter().flatten().rev().map(|c| (c.value(), depth + 1)));
        }
    }
    order
}

fn parents(source: &Source<'_>) -> Result<Vec<Option<usize>>, ImportError> {
    let mut parents: Vec<Option<usize>> = vec![None; source.root.nodes.len()];
    for (i, node) in source.root.nodes.iter().enumerate() {
        for (k, child) in node.children.iter().flatten().enumerate() {
            if let Some(other) = parents[child.value()].replace(i) {
                let cause = format!("node {} is already a child of node {other}", child.value());
                return Err(source.invalid(format!("/nodes/{i}/children/{k}"), cause));
            }
        }
    }
    Ok(parents)
}

fn scene_roots(source: &Source<'_>, scene: usize, parents: &[Option<usize>]) -> Result<Vec<usize>, ImportError> {
    let roots: Vec<usize> = source.root.scenes[scene].nodes.iter().map(|n| n.value()).collect();
    let mut seen = vec![false; parents.len()];
    for (k, &i) in roots.iter().enumerate() {
        let place = || format!("/scenes/{scene}/nodes/{k}");
        if let Some(parent) = parents[i] {
            return Err(source.invalid(place(), format!("node {i} is no root: it is a child of node {parent}")));
        }
        if std::mem::replace(&mut seen[i], true) {
            return Err(source.invalid(place(), format!("node {i} is listed twice")));
        }
    }
    Ok(roots)
}

/// KHR_node_visibility: a hidden node hides what is below it.
fn visible(node: &Node) -> bool {
    let extension = node.extensions.as_ref().and_then(|e| e.others.get("KHR_node_visibility"));
    extension.and_then(|e| e.get("visible")).and_then(Value::as_bool).unwrap_or(true)
}

/// From a node's space to its parent's.
fn local(
    source: &Source<'_>,
    index: usize,
    node: &Node,
    json: &Value,
    report: &mut Report,
) -> Result<DAffine3, ImportError> {
    let place = |key: &str| format!("/nodes/{index}/{key}");
    let affine = if let Some(m) = numbers::<16>(json, "matrix") {
        if node.translation.is_some() || node.rotation.is_some() || node.scale.is_some() {
            return Err(source.invalid(place("matrix"), "stands beside translation, rotation or scale"));
        }
        let last = [m[3], m[7], m[11], m[15]];
        if last != [0.0, 0.0, 0.0, 1.0] {
            let cause = format!("is not affine: its last row is {last:?}, expected [0, 0, 0, 1]");
            return Err(source.invalid(place("matrix"), cause));
        }
        let column = |k: usize| DVec3::new(m[k], m[k + 1], m[k + 2]);
        DAffine3 { matrix3: DMat3::from_cols(column(0), column(4), column(8)), translation: column(12) }
    } else {
        let rotation = DQuat::from_array(numbers(json, "rotation").unwrap_or([0.0, 0.0, 0.0, 1.0]));
        let length = rotation.length();
        if !(length > 1e-6 && length.is_finite()) {
            return Err(source.invalid(place("rotation"), format!("a quaternion of length {length}; expected 1")));
        }
        if (length - 1.0).abs() > 1e-3 {
            let cause = format!("a quaternion of length {length:.6} is taken as one of length 1");
            report.warn(source.file, place("rotation"), cause);
        }
        DAffine3::from_scale_rotation_translation(
            DVec3::from_array(numbers(json, "scale").unwrap_or([1.0; 3])),
            rotation / length,
            DVec3::from_array(numbers(json, "translation").unwrap_or([0.0; 3])),
        )
    };
    Ok(affine)
}

/// An array of numbers, if it is there; that it has the right length was checked with the typed model.
fn numbers<const N: usize>(json: &Value, key: &str) -> Option<[f64; N]> {
    let values = json.get(key)?.as_array()?;
    let mut numbers = [0.0; N];
    for (number, value) in numbers.iter_mut().zip(values) {
        *number = value.as_f64()?;
    }
    Some(numbers)
}

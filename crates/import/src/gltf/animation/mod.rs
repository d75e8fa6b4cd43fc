//! Animations: the file's JSON as it is at one time (glTF 2.0 specification, section 3.11; KHR_animation_pointer).
//!
//! What an animation says is written into the JSON before anything else looks at it. So whatever reads a property of a
//! node, a material, a camera or a light reads it as it is at that time, and no reader knows of animations.

mod curve;
mod pointer;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::{Index, Root};
use serde::Deserialize;
use serde_json::Value;

use super::accessor::Accessor;
use super::json;
use super::source::Source;
use crate::{AnimationChoice, AnimationInfo, ErrorKind, ImportError, Play, Report};
use curve::{Curve, Interpolation};
use pointer::Property;

pub use pointer::{Kind, PROPERTIES, Property as AnimatedProperty};

#[derive(Deserialize)]
struct JsonAnimation {
    channels: Vec<JsonChannel>,
    samplers: Vec<JsonSampler>,
}

#[derive(Deserialize)]
struct JsonChannel {
    sampler: usize,
    target: JsonTarget,
}

#[derive(Deserialize)]
struct JsonTarget {
    node: Option<usize>,
    path: String,
    extensions: Option<Value>,
}

#[derive(Deserialize)]
struct JsonSampler {
    input: usize,
    #[serde(default)]
    interpolation: Interpolation,
    output: usize,
}

/// What the animations of a file are called and how long they are. Nothing in them is checked.
pub(super) fn list(animations: &[Value], root: &Root) -> Vec<AnimationInfo> {
    let one = |(i, json): (usize, &Value)| {
        let name = json.get("name").and_then(Value::as_str);
        let array = |key| json.get(key).and_then(Value::as_array).into_iter().flatten();
        // The format asks for the last time of each sampler beside its accessor.
        let last = |sampler: &Value| {
            let input = sampler.get("input")?.as_u64()?;
            root.accessors.get(usize::try_from(input).ok()?)?.max.as_ref()?.get(0)?.as_f64()
        };
        AnimationInfo {
            name: name.map_or_else(|| format!("animation {i}"), str::to_owned),
            seconds: array("samplers").filter_map(last).fold(0.0, f64::max),
            channels: array("channels").count() as u64,
        }
    };
    animations.iter().enumerate().map(one).collect()
}

/// The numbers of the animations that are asked for.
///
/// # Errors
/// If the file has no such animation; the error names those that it has.
pub(super) fn choose(file: &Path, play: &Play, report: &Report) -> Result<Vec<usize>, ImportError> {
    let list = &report.animations;
    let wanted = match &play.animation {
        AnimationChoice::First => return Ok((0..list.len().min(1)).collect()),
        AnimationChoice::All => return Ok((0..list.len()).collect()),
        AnimationChoice::Named(wanted) => wanted,
    };
    json::by_name(file, "animation", wanted, list.iter().map(|a| a.name.as_str())).map(|i| vec![i])
}

/// The JSON and its typed model at a time. Both were those of the file.
///
/// # Errors
/// If an animation that is played breaks the format. What it changes that cannot be changed is a warning.
pub(super) fn pose(
    source: &Source<'_>,
    animations: &[Value],
    play: &Play,
    value: &mut Value,
    report: &mut Report,
) -> Result<Root, ImportError> {
    let mut root = source.root.clone();
    let mut touched = BTreeSet::new();
    let mut read = 0;
    for number in choose(source.file, play, report)? {
        let place = format!("/animations/{number}");
        let json: JsonAnimation = json::typed(source.file, &place, &animations[number])?;
        let mut player = Player { source, place, report, pointers: BTreeMap::new(), read: &mut read };
        for (i, channel) in json.channels.iter().enumerate() {
            let Some((pointer, property)) = player.target(i, channel)? else { continue };
            let Some(sampler) = json.samplers.get(channel.sampler) else {
                let cause = format!("element {} does not exist: there are {}", channel.sampler, json.samplers.len());
                return Err(source.invalid(format!("{}/channels/{i}/sampler", player.place), cause));
            };
            let curve = player.curve(channel.sampler, sampler, property)?;
            let numbers = curve.at(play.time);
            if player.put(i, &pointer, property, &numbers, value) {
                touched.insert(element(&pointer).to_owned());
            }
        }
    }
    for element in &touched {
        retype(source.file, element, value, &mut root)?;
    }
    Ok(root)
}

/// Plays one animation.
struct Player<'a> {
    source: &'a Source<'a>,
    /// Where the animation is in the file.
    place: String,
    report: &'a mut Report,
    /// What was changed by now, and by which channel.
    pointers: BTreeMap<String, usize>,
    /// How many keys were read by all animations, those of shared samplers each time.
    read: &'a mut u64,
}

impl Player<'_> {
    /// What a channel changes: the pointer, and the property that it is. `None`, perhaps with a warning: nothing.
    fn target(&mut self, i: usize, json: &JsonChannel) -> Result<Option<(String, &'static Property)>, ImportError> {
        let place = format!("{}/channels/{i}/target", self.place);
        let JsonTarget { node, path, extensions } = &json.target;
        let pointer = if path == "pointer" {
            let extension = extensions.as_ref().and_then(|e| e.get("KHR_animation_pointer"));
            let Some(pointer) = extension.and_then(|e| e.get("pointer")).and_then(Value::as_str) else {
                let at = format!("{place}/extensions/KHR_animation_pointer/pointer");
                return Err(self.source.invalid(at, "a channel of the path \"pointer\" must have one here"));
            };
            pointer.to_owned()
        } else {
            // By the specification a channel without a node is passed over.
            let Some(node) = node else { return Ok(None) };
            let count = self.source.root.nodes.len();
            if *node >= count {
                let cause = format!("element {node} does not exist: there are {count}");
                return Err(self.source.invalid(place + "/node", cause));
            }
            format!("/nodes/{node}/{path}")
        };
        let Some(property) = pointer::find(&pointer) else {
            self.warn(place, format!("'{pointer}' is nothing that can be animated here: it stays as it is"));
            return Ok(None);
        };
        if let Some(other) = self.pointers.insert(pointer.clone(), i) {
            self.warn(place, format!("'{pointer}' is changed by channel {other} too: this one counts"));
        }
        Ok(Some((pointer, property)))
    }

    /// A sampler's keys as they are for a property.
    fn curve(&mut self, i: usize, json: &JsonSampler, property: &Property) -> Result<Curve, ImportError> {
        let place = |key: &str| format!("{}/samplers/{i}/{key}", self.place);
        let source = self.source;
        let accessor = |index: usize, key: &str| {
            let count = source.root.accessors.len();
            if index >= count {
                let cause = format!("element {index} does not exist: there are {count}");
                return Err(source.invalid(place(key), cause));
            }
            Accessor::new(source, Index::new(index as u32))
        };
        let input = accessor(json.input, "input")?;
        if input.kind != Type::Scalar || input.format.0 != ComponentType::F32 {
            return Err(source.invalid(place("input"), "expected SCALAR of floats (5126)"));
        }
        let times: Vec<f64> = input.floats::<1>().as_flattened().iter().map(|&t| f64::from(t)).collect();
        if times.is_empty() {
            return Err(source.invalid(place("input"), "has no keys"));
        }
        if let Some(k) = times.iter().position(|t| !t.is_finite()) {
            return Err(source.invalid(place("input"), format!("time {k} is not finite: {}", times[k])));
        }
        if let Some(k) = (1..times.len()).find(|&k| times[k] < times[k - 1]) {
            let cause = format!("time {} (number {k}) comes after {}", times[k], times[k - 1]);
            return Err(source.invalid(place("input"), cause));
        }

        let output = accessor(json.output, "output")?;
        *self.read = self.read.saturating_add((input.count + output.count) as u64);
        if *self.read > source.limits.elements {
            let cause = "channels share so many keys that reading them would take too long";
            return Err(source.at(place("output"), ErrorKind::Limit(cause.into())));
        }
        let values: Vec<f64> = numbers(&output).into_iter().map(f64::from).collect();
        let elements = times.len() * json.interpolation.elements();
        let width = match property.kind {
            Kind::Numbers(count) => count,
            Kind::Rotation => 4,
            Kind::Switch => 1,
            Kind::Weights => values.len() / elements,
        };
        let kind = match width {
            2 if property.kind != Kind::Weights => Type::Vec2,
            3 if property.kind != Kind::Weights => Type::Vec3,
            4 if property.kind != Kind::Weights => Type::Vec4,
            _ => Type::Scalar,
        };
        if output.kind != kind {
            let cause = format!("accessor {} is {:?}; expected {kind:?}", json.output, output.kind);
            return Err(source.invalid(place("output"), cause));
        }
        if width == 0 || values.len() != elements * width {
            let cause = format!("{} numbers for {} keys of {:?}", values.len(), times.len(), json.interpolation);
            return Err(source.invalid(place("output"), cause));
        }
        if let Some(k) = values.iter().position(|x| !x.is_finite()) {
            return Err(source.invalid(place("output"), format!("number {k} is not finite: {}", values[k])));
        }
        if property.kind == Kind::Switch && json.interpolation == Interpolation::CubicSpline {
            return Err(source.invalid(place("interpolation"), "there is no spline between true and false"));
        }
        let equal = (1..times.len()).find(|&k| times[k] == times[k - 1]);
        let rotation = property.kind == Kind::Rotation;
        // Nothing lies between true and false.
        let interpolation = if property.kind == Kind::Switch { Interpolation::Step } else { json.interpolation };
        let mut curve = Curve { times, values, width, interpolation, rotation };
        if rotation && let Err(key) = curve.normalize() {
            return Err(source.invalid(place("output"), format!("the quaternion of key {key} has no direction")));
        }
        if let Some(k) = equal {
            let message = format!("keys {} and {k} are at one time, {}: the later counts", k - 1, curve.times[k]);
            let at = place("input");
            self.warn(at, message);
        }
        Ok(curve)
    }

    /// Puts a property's value into the JSON. `false`, with a warning, if it is not there to be changed.
    fn put(&mut self, i: usize, pointer: &str, property: &Property, numbers: &[f64], value: &mut Value) -> bool {
        let place = || format!("{}/channels/{i}/target", self.place);
        let fault = match property.kind {
            Kind::Weights => wrong_weights(value, pointer, numbers.len()),
            _ if pointer.contains("/weights/") => default_weights(value, pointer),
            _ if pointer.starts_with("/nodes/")
                && value.pointer(&(element(pointer).to_owned() + "/matrix")).is_some() =>
            {
                Some("the node has a matrix, which does not come apart".into())
            }
            _ => None,
        };
        if let Some(fault) = fault {
            self.warn(place(), format!("'{pointer}': {fault}: it stays as it is"));
            return false;
        }
        let new = match (property.kind, numbers) {
            (Kind::Switch, [x]) => Value::Bool(*x != 0.0),
            (Kind::Numbers(1), [x]) => Value::from(*x),
            _ => Value::from(numbers.to_vec()),
        };
        let there = pointer::write(value, pointer, new);
        if !there {
            self.warn(place(), format!("'{pointer}' leads nowhere: nothing is changed"));
        }
        there
    }

    fn warn(&mut self, place: String, message: String) {
        self.report.warn(self.source.file, place, message);
    }
}

/// All numbers of an accessor.
fn numbers(accessor: &Accessor<'_>) -> Vec<f32> {
    match accessor.kind {
        Type::Scalar => accessor.floats::<1>().into_flattened(),
        Type::Vec2 => accessor.floats::<2>().into_flattened(),
        Type::Vec3 => accessor.floats::<3>().into_flattened(),
        Type::Vec4 => accessor.floats::<4>().into_flattened(),
        // No property is a matrix.
        Type::Mat2 | Type::Mat3 | Type::Mat4 => Vec::new(),
    }
}

/// Why there cannot be so many weights here.
fn wrong_weights(value: &Value, pointer: &str, count: usize) -> Option<String> {
    let targets = morph_targets(value, pointer);
    (targets != count).then(|| format!("{count} weights for {targets} morph targets"))
}

/// Where a mesh or node has no weights of its own, gives it those that it has by default, so that one of them can be
/// changed. The answer is why that cannot be done.
fn default_weights(value: &mut Value, pointer: &str) -> Option<String> {
    let element = element(pointer).to_owned();
    let list = format!("{element}/weights");
    if value.pointer(&list).is_none_or(|v| !v.is_array()) {
        let mesh = mesh_of(value, pointer);
        let of_mesh = mesh.and_then(|m| value.pointer(&format!("/meshes/{m}/weights"))).cloned();
        let weights = of_mesh.unwrap_or_else(|| Value::from(vec![0.0; morph_targets(value, pointer)]));
        if !pointer::write(value, &list, weights) {
            return Some("there is no such element".into());
        }
    }
    None
}

/// How many morph targets the mesh has that a pointer to weights leads to.
fn morph_targets(value: &Value, pointer: &str) -> usize {
    let first = mesh_of(value, pointer).and_then(|m| value.pointer(&format!("/meshes/{m}/primitives/0/targets")));
    first.and_then(Value::as_array).map_or(0, Vec::len)
}

/// The mesh that a pointer leads to, by itself or by its node.
fn mesh_of(value: &Value, pointer: &str) -> Option<u64> {
    let element = element(pointer);
    match element.strip_prefix("/meshes/") {
        Some(number) => number.parse().ok(),
        None => value.pointer(element)?.get("mesh")?.as_u64(),
    }
}

/// The element that a pointer leads into: `/nodes/3` of `/nodes/3/scale`, `/extensions` of what is below it.
fn element(pointer: &str) -> &str {
    if pointer.starts_with("/extensions/") {
        return "/extensions";
    }
    pointer.match_indices('/').nth(2).map_or(pointer, |(end, _)| &pointer[..end])
}

/// Reads an element that has changed into the typed model.
fn retype(file: &Path, element: &str, value: &Value, root: &mut Root) -> Result<(), ImportError> {
    let Some(json) = value.pointer(element) else { return Ok(()) };
    let (list, i) = element.rsplit_once('/').unwrap_or_default();
    let i = pointer::index(i).unwrap_or(usize::MAX);
    match list {
        "/nodes" => replace(&mut root.nodes, i, json::typed(file, element, json)?),
        "/meshes" => replace(&mut root.meshes, i, json::typed(file, element, json)?),
        "/cameras" => replace(&mut root.cameras, i, json::typed(file, element, json)?),
        "/materials" => replace(&mut root.materials, i, json::typed(file, element, json)?),
        _ => root.extensions = json::typed(file, element, json)?,
    }
    Ok(())
}

fn replace<T>(list: &mut [T], i: usize, new: T) {
    if let Some(old) = list.get_mut(i) {
        *old = new;
    }
}

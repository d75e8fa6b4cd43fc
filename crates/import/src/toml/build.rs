//! From the words of a scene file to a scene.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use firsthit_geometry::transform::Transform;
use glam::{DAffine3, Vec3};

use super::schema::{Conventions, Film, Model, Object, SceneFile};
use super::shapes::{self, Body};
use super::{Inclusion, lights, materials, place};
use crate::files::Folder;
use crate::open::{Format, read_as};
use crate::place::Placeable;
use crate::scene::{EnvironmentDesc, GeometryDesc, InstanceDesc, MaterialDesc, MaterialModel, MeshDesc, SurfaceDesc};
use crate::{ErrorKind, ImportError, Imported, Options, Report, SceneDesc, image};

/// Builds the scene of a file. `inclusion` is how it was reached, itself included.
pub(super) fn build(
    scene_file: SceneFile,
    path: &Path,
    is_json: bool,
    options: &Options,
    inclusion: &Inclusion,
) -> Result<Imported, ImportError> {
    let by_notation = if is_json { Conventions::Reference } else { Conventions::Firsthit };
    let mut report = Report::default();
    report.reads(path);
    let mut builder = Builder {
        path,
        folder: Folder::of(path, &options.limits)?,
        options: Options { up: None, only: Vec::new(), ..options.clone() },
        inclusion,
        reference: scene_file.conventions.unwrap_or(by_notation) == Conventions::Reference,
        scene: SceneDesc::default(),
        report,
        material_index: HashMap::new(),
        default_material: None,
        images: HashMap::new(),
        models: HashMap::new(),
        triangles: 0,
        placed_triangles: 0,
        placed: 0,
    };
    builder.file(scene_file)?;
    let Builder { mut scene, mut report, placed_triangles, .. } = builder;
    scene.drop_unused_materials();
    scene.drop_unused_images();
    report.triangles_all_scenes = placed_triangles;
    Ok(Imported { scene, report })
}

pub(super) struct Builder<'a> {
    path: &'a Path,
    folder: Folder,
    options: Options,
    inclusion: &'a Inclusion,
    pub(super) reference: bool,
    pub(super) scene: SceneDesc,
    report: Report,
    material_index: HashMap<String, usize>,
    /// For shapes without a material, made when first needed.
    default_material: Option<usize>,
    /// By the real path of the file.
    images: HashMap<PathBuf, usize>,
    /// Models that were read already, by file and by what was made of their materials.
    models: HashMap<ModelKey, Rc<ReadModel>>,
    /// In all meshes.
    triangles: u64,
    /// After instancing, with the scenes of models that are not shown.
    placed_triangles: u64,
    /// What counts against the limit of instances.
    placed: u64,
}

/// A model whose data the scene has.
struct ReadModel {
    parts: Placeable,
    triangles_all_scenes: u64,
}

type ModelKey = (PathBuf, Option<usize>, Vec<(String, usize)>);

impl Builder<'_> {
    fn file(&mut self, file: SceneFile) -> Result<(), ImportError> {
        let stem = || self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        self.scene.name = file.name.unwrap_or_else(stem);
        self.scene.settings.reference_conventions = self.reference;
        self.scene.settings.resolution = match file.film {
            Some(film) => Some(resolution(&film).map_err(|e| self.invalid("film", e))?),
            None => None,
        };
        self.scene.settings.max_path_edges = match file.max_depth {
            None => None,
            Some(-1) => Some(u32::MAX),
            Some(n) => Some(u32::try_from(n).ok().filter(|&n| n > 0).ok_or_else(|| {
                self.invalid("max_depth", format!("must be -1 (unlimited) or at least 1 path edge, but is {n}"))
            })?),
        };
        for (name, material) in &file.materials.0 {
            let index = self.material(name, material)?;
            self.material_index.insert(name.clone(), index);
        }
        for (place, camera) in
            file.camera.iter().map(|c| ("camera".to_owned(), c)).chain(numbered("cameras", &file.cameras))
        {
            let camera = lights::camera(camera).map_err(|e| self.invalid(&place, e))?;
            self.scene.cameras.push(camera);
        }
        self.placed = (self.scene.cameras.len() + file.lights.len()) as u64;
        self.scene.settings.camera = (!self.scene.cameras.is_empty()).then_some(0);
        for (place, light) in numbered("lights", &file.lights) {
            let light = lights::light(light, self.reference).map_err(|e| self.invalid(&place, e))?;
            self.scene.lights.push(light);
        }
        self.scene.environment = match &file.env {
            Some(env) => Some(self.environment(env)?),
            None if self.reference => Some(EnvironmentDesc::Constant { radiance: Vec3::ZERO }),
            None => None,
        };
        self.scene.fog = match &file.fog {
            Some(fog) => Some(lights::fog(fog).map_err(|e| self.invalid("fog", e))?),
            None => None,
        };
        for (place, object) in numbered("objects", &file.objects) {
            self.object(&place, object)?;
        }
        Ok(())
    }

    fn object(&mut self, place: &str, object: &Object) -> Result<(), ImportError> {
        let invalid = |e: String| self.invalid(place, e);
        let transform = match &object.transform {
            Some(t) => place::affine(t).map_err(invalid)?,
            None => DAffine3::IDENTITY,
        };
        let material = match &object.material {
            Some(name) => Some(self.material_named(place, name)?),
            None => None,
        };
        let moves_to = match &object.moves_to {
            Some(t) => Some(place::affine(t).map_err(invalid)?),
            None => None,
        };
        let first = self.scene.instances.len();
        let named = |kind: &str| object.name.clone().unwrap_or_else(|| kind.to_owned());
        match shapes::body(&object.shape).map_err(invalid)? {
            Body::Model(model) => self.model(place, model, material, transform),
            Body::Mesh(mesh) => self.surface(named("mesh"), SurfaceDesc::Triangles(mesh), material, transform),
            Body::Shape(shape, standing) => {
                self.surface(named(shape.kind()), SurfaceDesc::Shape(*shape), material, transform * standing)
            }
        }?;
        if let Some(moves_to) = moves_to {
            // All of the object, by what takes it from here to there.
            let by = moves_to * transform.inverse();
            if !by.is_finite() || Transform::new(moves_to).is_err() {
                return Err(self.invalid(place, "what is flat cannot move: see 'transform' and 'moves_to'"));
            }
            for instance in &mut self.scene.instances[first..] {
                instance.moves_to = Some(by * instance.moves_to.unwrap_or(instance.transform));
            }
        }
        Ok(())
    }

    /// Adds a mesh of one surface, with its instance.
    fn surface(
        &mut self,
        name: String,
        surface: SurfaceDesc,
        material: Option<usize>,
        transform: DAffine3,
    ) -> Result<(), ImportError> {
        let material = Some(material.unwrap_or_else(|| self.default_material()));
        let geometry = GeometryDesc { name: name.clone(), surface, material };
        let mesh = MeshDesc { name: name.clone(), geometries: vec![geometry] };
        self.triangles += triangles(&mesh);
        self.placed_triangles += triangles(&mesh);
        self.scene.meshes.push(mesh);
        let instance = InstanceDesc { name, mesh: self.scene.meshes.len() - 1, transform, moves_to: None };
        self.place(&Placeable { instances: vec![instance], ..Placeable::default() }, DAffine3::IDENTITY)
    }

    fn model(
        &mut self,
        place: &str,
        model: &Model,
        material: Option<usize>,
        transform: DAffine3,
    ) -> Result<(), ImportError> {
        let path = self.find(place, &model.file)?;
        let mut renamed = Vec::new();
        for (theirs, ours) in &model.materials.0 {
            renamed.push((theirs.clone(), self.material_named(place, ours)?));
        }
        let key = (path.canonicalize().map_err(|e| ImportError::io(&path, e))?, material, renamed);
        let read = match self.models.get(&key) {
            Some(read) => Rc::clone(read),
            None => {
                let read = Rc::new(self.read_model(place, &path, material, &key.2)?);
                self.models.insert(key, Rc::clone(&read));
                read
            }
        };
        self.placed_triangles = self.placed_triangles.saturating_add(read.triangles_all_scenes);
        let turned = model.up.map_or(DAffine3::IDENTITY, |up| up.0.to_y());
        self.place(&read.parts, transform * turned)
    }

    /// Places parts of the scene, if there is room for them.
    fn place(&mut self, parts: &Placeable, transform: DAffine3) -> Result<(), ImportError> {
        self.placed = self.placed.saturating_add(parts.count());
        let limits = &self.options.limits;
        // Files that name each other again and again make much of little.
        let mut most = limits.instances_of(0);
        if self.placed > most {
            let bytes = |file: &PathBuf| std::fs::metadata(file).map_or(0, |m| m.len());
            most = limits.instances_of(self.report.files.iter().map(bytes).sum());
        }
        for (count, limit, what) in
            [(self.placed, most, "instances, lights and cameras"), (self.triangles, limits.elements, "triangles")]
        {
            if count > limit {
                let cause = format!("{count} {what} are more than the limit of {limit}");
                return Err(ImportError::new(self.path, "objects", ErrorKind::Limit(cause)));
            }
        }
        self.scene.place(parts.clone(), transform);
        Ok(())
    }

    fn read_model(
        &mut self,
        place: &str,
        path: &Path,
        material: Option<usize>,
        renamed: &[(String, usize)],
    ) -> Result<ReadModel, ImportError> {
        let format = Format::of(path)?;
        let Imported { scene: mut model, report } =
            read_as(format, path, &self.options, self.inclusion, &mut |_, _| Ok(()))?;
        let triangles_all_scenes = report.triangles_all_scenes;
        self.report.absorb(report);

        // What each of the model's materials is replaced by.
        let mut replaced: Vec<Option<usize>> = vec![material; model.materials.len()];
        if self.reference && format == Format::Obj {
            for (material, new) in model.materials.iter_mut().zip(&mut replaced) {
                *new = new.or_else(|| self.material_index.get(&material.name).copied());
                materials::as_reference(material);
            }
        }
        for (theirs, ours) in renamed {
            let Some(i) = model.materials.iter().position(|m| m.name == *theirs) else {
                let cause = no_such("the model's material", theirs, model.materials.iter().map(|m| m.name.as_str()));
                return Err(self.invalid(place, cause));
            };
            replaced[i] = Some(*ours);
        }

        // Images that only replaced materials show are not kept; what the others take, the next models cannot.
        for (material, _) in model.materials.iter_mut().zip(&replaced).filter(|(_, new)| new.is_some()) {
            material.model = MaterialModel::Pbr(Box::default());
        }
        model.drop_unused_images();
        let limits = &mut self.options.limits;
        limits.image_bytes =
            model.images.iter().fold(limits.image_bytes, |left, i| left.saturating_sub(i.pixels.bytes()));

        let (first_mesh, first_material) = (self.scene.meshes.len(), self.scene.materials.len());
        let parts = self.scene.adopt(model);
        self.triangles += self.scene.meshes[first_mesh..].iter().map(triangles).sum::<u64>();
        for geometry in self.scene.meshes[first_mesh..].iter_mut().flat_map(|m| &mut m.geometries) {
            geometry.material = match geometry.material {
                Some(i) => replaced[i - first_material].or(Some(i)),
                None => material,
            };
        }
        Ok(ReadModel { parts, triangles_all_scenes })
    }

    fn material_named(&self, place: &str, name: &str) -> Result<usize, ImportError> {
        self.material_index.get(name).copied().ok_or_else(|| {
            let mut names: Vec<_> = self.material_index.keys().map(String::as_str).collect();
            names.sort_unstable();
            self.invalid(place, no_such("material", name, names))
        })
    }

    /// Light grey and matt, seen from both sides.
    fn default_material(&mut self) -> usize {
        *self.default_material.get_or_insert_with(|| {
            let model = MaterialModel::Diffuse { albedo: Vec3::splat(0.8) };
            self.scene.materials.push(MaterialDesc { name: "default".into(), model });
            self.scene.materials.len() - 1
        })
    }

    /// The index of an image file's content, read once.
    pub(super) fn image(&mut self, place: &str, file: &str) -> Result<usize, ImportError> {
        let path = self.find(place, file)?;
        let real = path.canonicalize().map_err(|e| ImportError::io(&path, e))?;
        if let Some(&index) = self.images.get(&real) {
            return Ok(index);
        }
        self.report.files.insert(real.clone());
        let image = image::read(&path, &self.options.limits)?;
        // What one image takes, the next ones cannot.
        let limits = &mut self.options.limits;
        limits.image_bytes = limits.image_bytes.saturating_sub(image.pixels.bytes());
        self.scene.images.push(image);
        self.images.insert(real, self.scene.images.len() - 1);
        Ok(self.scene.images.len() - 1)
    }

    fn find(&self, place: &str, file: &str) -> Result<PathBuf, ImportError> {
        self.folder.find(file).map_err(|kind| {
            let kind = match kind {
                ErrorKind::Io(e) => ErrorKind::Io(io::Error::new(e.kind(), format!("cannot read '{file}': {e}"))),
                other => other,
            };
            ImportError::new(self.path, place, kind)
        })
    }

    pub(super) fn invalid(&self, place: &str, cause: impl Into<String>) -> ImportError {
        ImportError::invalid(self.path, place, cause)
    }
}

/// `name[0]`, `name[1]`, ... with the items.
fn numbered<'a, T>(name: &'a str, items: &'a [T]) -> impl Iterator<Item = (String, &'a T)> {
    items.iter().enumerate().map(move |(i, item)| (format!("{name}[{i}]"), item))
}

fn no_such<'a>(what: &str, name: &str, there: impl IntoIterator<Item = &'a str>) -> String {
    let there: Vec<_> = there.into_iter().map(|n| format!("'{n}'")).collect();
    let there = if there.is_empty() { "none".to_owned() } else { there.join(", ") };
    format!("{what} '{name}' does not exist; there are: {there}")
}

fn resolution(film: &Film) -> Result<(u32, u32), String> {
    if film.width == 0 || film.height == 0 {
        return Err("'width' and 'height' must be at least 1".to_owned());
    }
    // The words that reference scenes have for what is done anyway.
    for (key, value, only) in [("filter", &film.filter, "box 1px"), ("space", &film.space, "linear Rec.709")] {
        if let Some(value) = value.as_ref().filter(|v| *v != only) {
            return Err(format!("'{key}' can only be \"{only}\", but is \"{value}\""));
        }
    }
    Ok((film.width, film.height))
}

fn triangles(mesh: &MeshDesc) -> u64 {
    let of = |g: &GeometryDesc| match &g.surface {
        SurfaceDesc::Triangles(m) => m.triangles.len() as u64,
        SurfaceDesc::Shape(_) => 0,
    };
    mesh.geometries.iter().map(of).sum()
}

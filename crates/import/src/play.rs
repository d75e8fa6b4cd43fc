//! Which moment of which animation is looked at.

/// A moment of a file's animations.
///
/// ```
/// use firsthit_import::{AnimationChoice, Options, Play};
/// let play = Play { animation: AnimationChoice::Named("Walk".into()), time: 1.25, ..Play::default() };
/// let options = Options { play: Some(play), ..Options::default() };
/// # let _ = options;
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Play {
    /// Which of the animations.
    pub animation: AnimationChoice,
    /// Seconds from its beginning. Before its first key and after its last all is as at that key.
    pub time: f64,
    /// For how many seconds the camera's shutter is open from then on: what moves meanwhile gets
    /// [`moves_to`](crate::scene::InstanceDesc::moves_to), as do vertices and cameras.
    pub shutter: f64,
}

/// Which animations of a file are played.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AnimationChoice {
    /// The first, if there is any.
    #[default]
    First,
    /// All at once; where two change the same, the later one counts.
    All,
    /// One, by its name or else by its number from 0.
    Named(String),
}

/// An animation of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AnimationInfo {
    /// Its name, or its number in words.
    pub name: String,
    /// When its last key is, in seconds, as the file says.
    pub seconds: f64,
    /// How many properties it changes.
    pub channels: u64,
}

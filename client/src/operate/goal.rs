//! What a task asks for, as the server tells it.

use wheelarm_proto::check::Invalid;
use wheelarm_proto::v1;

use super::block::Block;
use super::scene::SceneModel;

/// What a task asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    /// A thing is to be lifted and held.
    Lift {
        /// Index of the thing.
        item: usize,
    },
    /// A thing is to be put into a region and left there.
    Put {
        /// Index of the thing.
        item: usize,
        /// The region in `house`.
        region: Block,
    },
    /// A slide is to be pulled open.
    Open {
        /// Index of the thing that slides.
        item: usize,
        /// Index of the slide.
        slide: usize,
        /// Wanted joint position, metres.
        position: f64,
    },
}

impl Goal {
    /// The thing that the hand takes.
    #[must_use]
    pub fn item(&self) -> usize {
        match self {
            Self::Lift { item } | Self::Put { item, .. } | Self::Open { item, .. } => *item,
        }
    }

    /// Reads what the scene's answer says; `None` without a task.
    ///
    /// # Errors
    /// [`Invalid`] when it names what is not there.
    pub fn read(reply: &v1::SceneReply, scene: &SceneModel) -> Result<Option<Self>, Invalid> {
        let item = |name: &str| scene.items.iter().position(|item| item.name == name);
        Ok(item(&reply.target).map(|item| Self::Lift { item }))
    }
}

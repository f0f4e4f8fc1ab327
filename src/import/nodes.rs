//! The node tree, flattened with parents before children.

use super::document::{Document, Element};
use crate::{
    Result,
    scene::{LocalTransform, Node},
};
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// The file's nodes and where they went.
pub(super) struct Nodes {
    /// Parents before children.
    pub nodes: Vec<Node>,
    /// For each node of the file, its index in `nodes`.
    pub scene_node: Vec<usize>,
    /// For each node of the file: whether the scene to render holds it.
    pub in_scene: Vec<bool>,
    /// JSON pointer of the scene to render; none if the file has no scenes.
    pub scene_place: Option<String>,
}

/// Reads all nodes.
pub(super) fn read(document: &Document) -> Result<Nodes> {
    let elements = document.elements("nodes")?;
    let count = elements.len();
    let mut children = Vec::with_capacity(count);
    let mut parent: Vec<Option<usize>> = vec![None; count];
    for (i, element) in elements.iter().enumerate() {
        let mut list = Vec::new();
        for child in element.items("children")? {
            let index = child.as_index()?;
            match parent.get_mut(index) {
                None => return Err(child.error(format!("there is no node {index}; export the file again"))),
                Some(Some(other)) => {
                    return Err(child.error(format!(
                        "node {index} is a child of node {other} already; a node has one parent"
                    )));
                }
                Some(slot) => *slot = Some(i),
            }
            list.push(index);
        }
        children.push(list);
    }
    // Depth first and without recursion: the hierarchy may be deeper than the stack.
    let mut order = Vec::with_capacity(count);
    let mut stack: Vec<usize> = (0..count).rev().filter(|&i| parent[i].is_none()).collect();
    while let Some(node) = stack.pop() {
        order.push(node);
        stack.extend(children[node].iter().rev());
    }
    let mut scene_node = vec![usize::MAX; count];
    for (new, &old) in order.iter().enumerate() {
        scene_node[old] = new;
    }
    if let Some(looped) = scene_node.iter().position(|&n| n == usize::MAX) {
        return Err(elements[looped].error("is its own ancestor; remove the cycle or export the file again"));
    }
    let mut nodes = Vec::with_capacity(count);
    for &old in &order {
        nodes.push(node(&elements[old], old, parent[old].map(|p| scene_node[p]))?);
    }
    let (roots, scene_place) = scene_roots(document, count)?;
    let mut in_scene = vec![false; count];
    let mut stack = roots.unwrap_or_else(|| (0..count).filter(|&i| parent[i].is_none()).collect());
    while let Some(node) = stack.pop() {
        if !std::mem::replace(&mut in_scene[node], true) {
            stack.extend(&children[node]);
        }
    }
    Ok(Nodes { nodes, scene_node, in_scene, scene_place })
}

/// The root nodes of the default scene, or of the first; none if the file has no scenes.
fn scene_roots(document: &Document, nodes: usize) -> Result<(Option<Vec<usize>>, Option<String>)> {
    let default = document.root().index("scene")?;
    if default.is_none() && document.count("scenes") == 0 {
        return Ok((None, None));
    }
    let scene = document.element("scenes", default.unwrap_or(0), "/scene")?;
    let mut roots = Vec::new();
    for item in scene.items("nodes")? {
        let index = item.as_index()?;
        if index >= nodes {
            return Err(item.error(format!("there is no node {index}; export the file again")));
        }
        roots.push(index);
    }
    Ok((Some(roots), Some(scene.place)))
}

fn node(element: &Element, index: usize, parent: Option<usize>) -> Result<Node> {
    let mut name = element.name();
    if name.is_empty() {
        name = format!("node {index}");
    }
    let visibility = match element.extension("KHR_node_visibility") {
        Some(extension) => extension.flag("visible")?.unwrap_or(true),
        None => true,
    };
    Ok(Node { name, parent, transform: transform(element)?, weights: Vec::new(), hidden: !visibility })
}

fn transform(element: &Element) -> Result<LocalTransform> {
    if let Some(m) = element.numbers::<16>("matrix")? {
        let column = |c: usize| DVec3::new(m[4 * c], m[4 * c + 1], m[4 * c + 2]);
        let matrix = DMat3::from_cols(column(0), column(1), column(2));
        return Ok(LocalTransform::Matrix(DAffine3::from_mat3_translation(matrix, column(3))));
    }
    let rotation = DQuat::from_array(element.numbers("rotation")?.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let length = rotation.length();
    Ok(LocalTransform::Trs {
        translation: element.numbers("translation")?.unwrap_or_default().into(),
        rotation: if length > 0.0 && length.is_finite() { rotation / length } else { DQuat::IDENTITY },
        scale: element.numbers("scale")?.unwrap_or([1.0; 3]).into(),
    })
}

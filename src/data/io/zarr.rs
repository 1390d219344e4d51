//! Zarr version 3 stores in folders, as needed for tables of draws: groups, and arrays of numbers with named
//! dimensions.
//!
//! Format: the Zarr core specification, version 3 (<https://zarr-specs.readthedocs.io/en/latest/v3/core/>). A group is
//! a folder with `zarr.json`; an array is one with `zarr.json` and its values in a single chunk, little-endian and in C
//! order, in `c/0`, `c/0/0`, ... The root repeats the nodes of all the others (`consolidated_metadata`): that is
//! zarr-python's addition to the specification, which other readers may ignore, and without which xarray warns.

use super::atomic::{WriteError, write_folder};
use serde::{Serialize, Serializer};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Attributes of a group or an array.
pub type Attributes = Map<String, Value>;

/// A group, the root of a store among them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Group {
    /// Its attributes.
    pub attributes: Attributes,
    /// Groups in it, by name.
    pub groups: Vec<(String, Group)>,
    /// Arrays in it.
    pub arrays: Vec<Array>,
}

/// An array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Its name in the group.
    pub name: String,
    /// Names and lengths of its dimensions; the last one runs fastest.
    pub dimensions: Vec<(&'static str, usize)>,
    /// As many as the product of the lengths.
    pub values: Values,
    /// Units and the like.
    pub attributes: Attributes,
}

/// Values of an array.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// `float64`.
    Floats(Vec<f64>),
    /// `int64`.
    Integers(Vec<i64>),
    /// `uint8`: codes whose meanings are in the attributes.
    Codes(Vec<u8>),
    /// `bool`.
    Booleans(Vec<bool>),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Values::Floats(values) => values.len(),
            Values::Integers(values) => values.len(),
            Values::Codes(values) => values.len(),
            Values::Booleans(values) => values.len(),
        }
    }

    /// Name of the type, and the fill value.
    fn data_type(&self) -> (&'static str, Value) {
        match self {
            Values::Floats(_) => ("float64", json!("NaN")),
            Values::Integers(_) => ("int64", json!(0)),
            Values::Codes(_) => ("uint8", json!(0)),
            Values::Booleans(_) => ("bool", json!(false)),
        }
    }

    fn bytes(&self) -> Vec<u8> {
        match self {
            Values::Floats(values) => values.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Values::Integers(values) => values.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Values::Codes(values) => values.clone(),
            Values::Booleans(values) => values.iter().map(|x| u8::from(*x)).collect(),
        }
    }
}

/// Writes a store, in place of the folder at `path` if there is one: the caller decides whether that may be replaced.
///
/// # Errors
/// A folder that cannot be written, a full disc; what was there is still there then.
pub fn write(path: &Path, root: &Group) -> Result<(), WriteError> {
    write_folder(path, &|folder| {
        std::fs::create_dir_all(folder)?;
        let mut nodes = Nodes(Vec::new());
        write_members(folder, root, "", &mut nodes)?;
        let consolidated_metadata = Consolidated { kind: "inline", must_understand: false, metadata: nodes };
        write_node(folder, &GroupNode { consolidated_metadata: Some(consolidated_metadata), ..group_node(root) })
    })
}

/// `zarr.json` of a group.
#[derive(Serialize)]
struct GroupNode<'a> {
    zarr_format: u8,
    node_type: &'static str,
    attributes: &'a Attributes,
    #[serde(skip_serializing_if = "Option::is_none")]
    consolidated_metadata: Option<Consolidated>,
}

#[derive(Serialize)]
struct Consolidated {
    kind: &'static str,
    must_understand: bool,
    metadata: Nodes,
}

/// Nodes by their paths. The order is what a reader lists them in, and members of a group must be contiguous.
struct Nodes(Vec<(String, Value)>);

impl Serialize for Nodes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(path, node)| (path, node)))
    }
}

fn group_node(group: &Group) -> GroupNode<'_> {
    GroupNode { zarr_format: 3, node_type: "group", attributes: &group.attributes, consolidated_metadata: None }
}

/// Writes everything that is in a group, and adds the nodes of it to `nodes`.
fn write_members(folder: &Path, group: &Group, path: &str, nodes: &mut Nodes) -> std::io::Result<()> {
    for array in &group.arrays {
        nodes.0.push((format!("{path}{}", array.name), write_array(&folder.join(&array.name), array)?));
    }
    for (name, inner) in &group.groups {
        let node = group_node(inner);
        std::fs::create_dir_all(folder.join(name))?;
        write_node(&folder.join(name), &node)?;
        nodes.0.push((format!("{path}{name}"), json!(node)));
    }
    group
        .groups
        .iter()
        .try_for_each(|(name, inner)| write_members(&folder.join(name), inner, &format!("{path}{name}/"), nodes))
}

fn write_array(folder: &Path, array: &Array) -> std::io::Result<Value> {
    let (names, shape): (Vec<&str>, Vec<usize>) = array.dimensions.iter().copied().unzip();
    assert_eq!(shape.iter().product::<usize>(), array.values.len(), "{}: as many values as it has places", array.name);
    let (data_type, fill_value) = array.values.data_type();
    std::fs::create_dir_all(folder)?;
    let node = json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": data_type,
        "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": shape } },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "fill_value": fill_value,
        "codecs": [{ "name": "bytes", "configuration": { "endian": "little" } }],
        "dimension_names": names,
        "attributes": array.attributes,
    });
    write_node(folder, &node)?;
    let chunk = shape.iter().fold(folder.join("c"), |path, _| path.join("0"));
    chunk.parent().map_or(Ok(()), std::fs::create_dir_all)?;
    std::fs::write(chunk, array.values.bytes())?;
    Ok(node)
}

fn write_node(folder: &Path, node: &impl Serialize) -> std::io::Result<()> {
    let mut json = serde_json::to_vec_pretty(node)?;
    json.push(b'\n');
    std::fs::write(folder.join("zarr.json"), json)
}

/// The attributes of the group at `path`; `None` if there is none that can be read.
pub fn attributes(path: &Path) -> Option<Attributes> {
    let text = std::fs::read(path.join("zarr.json")).ok()?;
    match serde_json::from_slice::<Value>(&text).ok()?.get_mut("attributes")?.take() {
        Value::Object(attributes) => Some(attributes),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_store_is_what_the_specification_says() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.zarr");
        let array = Array {
            name: "k".into(),
            dimensions: vec![("chain", 2), ("draw", 3)],
            values: Values::Floats(vec![1.0, 2.0, 3.0, 4.0, 5.0, -0.0]),
            attributes: Map::from_iter([("units".to_owned(), json!("km/s"))]),
        };
        let flags = Array {
            name: "accepted".into(),
            dimensions: vec![("draw", 3)],
            values: Values::Booleans(vec![true, false, true]),
            attributes: Map::new(),
        };
        let inner = Group { arrays: vec![array, flags], ..Group::default() };
        let attributes = Map::from_iter([("n".to_owned(), json!(1))]);
        let root = Group { attributes: attributes.clone(), groups: vec![("g".into(), inner)], arrays: Vec::new() };
        for _ in 0..2 {
            write(&path, &root).unwrap();
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
        }
        assert_eq!(super::attributes(&path), Some(attributes));
        assert_eq!(super::attributes(folder.path()), None);
        let bytes = std::fs::read(path.join("g/k/c/0/0")).unwrap();
        assert_eq!(bytes.len(), 48);
        assert_eq!(bytes[8..16], 2f64.to_le_bytes());
        assert_eq!(bytes[40..], (-0f64).to_le_bytes());
        assert_eq!(std::fs::read(path.join("g/accepted/c/0")).unwrap(), [1, 0, 1]);
        let node: Value = serde_json::from_slice(&std::fs::read(path.join("g/k/zarr.json")).unwrap()).unwrap();
        assert_eq!(node["dimension_names"], json!(["chain", "draw"]));
        assert_eq!(node["attributes"]["units"], "km/s");
        let root: Value = serde_json::from_slice(&std::fs::read(path.join("zarr.json")).unwrap()).unwrap();
        let all = root["consolidated_metadata"]["metadata"].as_object().unwrap();
        assert_eq!(all.len(), 3);
        assert_eq!(all["g/k"], node);
    }
}

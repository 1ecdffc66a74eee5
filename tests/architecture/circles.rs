//! Circles in a graph.

use std::collections::{BTreeMap, BTreeSet};

/// Groups of two or more that can each be reached from one another.
pub(crate) fn circles(edges: &BTreeSet<(String, String)>) -> Vec<Vec<String>> {
    let reach: BTreeMap<&str, BTreeSet<&str>> = edges
        .iter()
        .map(|(from, _)| (from.as_str(), reachable(from, edges)))
        .collect();
    let back = |a: &str, b: &str| reach.get(b).is_some_and(|from_b| from_b.contains(a));
    let mut found = BTreeSet::new();
    for (from, to) in &reach {
        let group: Vec<String> = to
            .iter()
            .filter(|other| back(from, other))
            .map(|&other| other.to_owned())
            .collect();
        if group.len() > 1 {
            found.insert(group);
        }
    }
    found.into_iter().collect()
}

fn reachable<'a>(from: &'a str, edges: &'a BTreeSet<(String, String)>) -> BTreeSet<&'a str> {
    let mut found = BTreeSet::new();
    let mut next = vec![from];
    while let Some(at) = next.pop() {
        let steps = edges.iter().filter(|(a, _)| a == at);
        next.extend(steps.map(|(_, b)| b.as_str()).filter(|b| found.insert(*b)));
    }
    found
}

#[test]
fn circles_are_found_and_mere_crossings_are_not() {
    let edges = |list: &[(&str, &str)]| {
        let pairs = list.iter().map(|(a, b)| (a.to_string(), b.to_string()));
        circles(&pairs.collect())
    };
    assert!(edges(&[("a", "b"), ("a", "c"), ("b", "d"), ("c", "d")]).is_empty());
    let found = edges(&[
        ("a", "b"),
        ("b", "c"),
        ("c", "b"),
        ("x", "y"),
        ("y", "z"),
        ("z", "x"),
    ]);
    assert_eq!(found, [vec!["b", "c"], vec!["x", "y", "z"]]);
}

//! The floors of ARCHITECTURE.md.

use std::collections::{BTreeMap, BTreeSet};

/// Rooms by crate and name, each with its floor, counted from the top.
#[derive(Debug, Default)]
pub(crate) struct Floors(BTreeMap<(String, String), usize>);

impl Floors {
    /// Reads the block of floors: the first block of code below the heading `Rooms and directions`.
    ///
    /// A line is a floor: the crate where it begins, rooms with one space in between, and after two spaces or
    /// more what they are.
    pub(crate) fn read(page: &str) -> Result<Floors, String> {
        let below = page.split("## Rooms and directions").nth(1);
        let block = below.and_then(|below| below.split("```").nth(1));
        let block = block.ok_or("ARCHITECTURE.md has no block below `## Rooms and directions`")?;
        let mut floors = Floors::default();
        let mut krate = String::new();
        for (floor, line) in block.lines().enumerate() {
            let columns = line.split("  ").map(str::trim);
            let mut columns = columns.filter(|column| !column.is_empty());
            if !line.starts_with(' ') {
                krate = columns.next().unwrap_or_default().to_owned();
            }
            for room in columns.next().unwrap_or_default().split_whitespace() {
                let new = floors.0.insert((krate.clone(), room.to_owned()), floor);
                if new.is_some() {
                    return Err(format!("ARCHITECTURE.md has `{room}` of `{krate}` twice"));
                }
            }
        }
        Ok(floors)
    }

    /// The floor of a room, counted from the top.
    pub(crate) fn of(&self, krate: &str, room: &str) -> Option<usize> {
        let key = (krate.to_owned(), room.to_owned());
        self.0.get(&key).copied()
    }

    /// Whether the page draws nothing of a crate but `lib` and `main`: all modules of its library are one room.
    pub(crate) fn is_one_room(&self, krate: &str) -> bool {
        let mut rooms = self.rooms(krate).into_iter();
        rooms.all(|room| matches!(room, "lib" | "main"))
    }

    /// The rooms of a crate.
    pub(crate) fn rooms(&self, krate: &str) -> BTreeSet<&str> {
        let of_it = self.0.keys().filter(|(of, _)| of == krate);
        of_it.map(|(_, room)| room.as_str()).collect()
    }

    /// The crates.
    pub(crate) fn crates(&self) -> BTreeSet<&str> {
        self.0.keys().map(|(krate, _)| krate.as_str()).collect()
    }
}

#[test]
fn floors_are_read_from_the_page() {
    let page = "
## Rooms and directions

Words.

```
upper    lib            the whole
         a b            two rooms

lower    lib c          three  columns
```
";
    let floors = Floors::read(page).unwrap();
    assert_eq!(
        floors.crates().into_iter().collect::<Vec<_>>(),
        ["lower", "upper"]
    );
    assert_eq!(
        floors.rooms("upper").into_iter().collect::<Vec<_>>(),
        ["a", "b", "lib"]
    );
    assert_eq!(
        floors.rooms("lower").into_iter().collect::<Vec<_>>(),
        ["c", "lib"]
    );
    assert!(floors.of("upper", "lib") < floors.of("upper", "a"));
    assert_eq!(floors.of("upper", "a"), floors.of("upper", "b"));
    assert!(floors.of("upper", "b") < floors.of("lower", "c"));
    assert!(Floors::read("no block").is_err());
    assert!(
        Floors::read(&page.replace("a b", "a a"))
            .unwrap_err()
            .contains("twice")
    );
}

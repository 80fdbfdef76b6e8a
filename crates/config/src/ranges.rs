//! Ranges of the numbers of a configuration.

use toml::{Table, Value};

use crate::error::Error;

/// Ranges of the numbers; written by `tests/config/test_rust_defaults.py`.
const RANGES: &str = include_str!("ranges.toml");

/// Least and largest values by key: a pair, or one for each item of a list.
#[derive(serde::Deserialize)]
pub(crate) struct Ranges {
    /// Keys without a default.
    pub(crate) optional: Vec<String>,
    /// Keys of `always` whose number is above the least value, not equal to it.
    above: Vec<String>,
    /// Keys of `always` whose number is below the largest value, not equal to it.
    below: Vec<String>,
    /// Of the keys that `safety.unusual` may name.
    usual: Table,
    always: Table,
}

impl Ranges {
    pub(crate) fn new() -> Result<Self, Error> {
        Ok(toml::from_str(RANGES)?)
    }

    /// The keys that `safety.unusual` names.
    fn named(&self, table: &Table) -> Result<Vec<String>, Error> {
        let names = table.get("safety").and_then(|own| own.get("unusual"));
        let names: Vec<String> = names.cloned().map_or(Ok(Vec::new()), Value::try_into)?;
        match names.iter().find(|name| !self.usual.contains_key(*name)) {
            Some(name) => Err(Error(format!(
                "safety.unusual: got {name:?}, expected the key of a number with a usual range"
            ))),
            None => Ok(names),
        }
    }

    /// No comparison with a number that is not finite would hold, so that each check with it would be off; a wrong unit does the same.
    pub(crate) fn check(&self, table: &Table) -> Result<(), Error> {
        let unusual = self.named(table)?;
        let mut numbers = Vec::new();
        for (name, value) in table {
            Number::collect(value, name.clone(), name.clone(), None, &mut numbers);
        }
        numbers.iter().try_for_each(|number| {
            let key = &number.key;
            if unusual.contains(key) {
                return number.check(None, [false; 2], "");
            }
            let open = [&self.above, &self.below].map(|keys| keys.contains(key));
            match self.usual.get(key) {
                None => number.check(self.always.get(key), open, ""),
                range => number.check(range, open, ", or named in safety.unusual"),
            }
        })
    }
}

/// A number of the configuration.
pub(crate) struct Number {
    /// Its key from the root, with the indices of lists.
    pub(crate) path: String,
    /// The key without indices.
    pub(crate) key: String,
    /// Its place in a list.
    item: usize,
    pub(crate) value: f64,
}

impl Number {
    /// The numbers of a value, in the order of the text.
    pub(crate) fn collect(
        value: &Value,
        path: String,
        key: String,
        item: Option<usize>,
        all: &mut Vec<Self>,
    ) {
        #[expect(clippy::cast_precision_loss, reason = "compared with a limit")]
        let number = match value {
            Value::Table(own) => {
                for (name, value) in own {
                    let [path, key] = [&path, &key].map(|at| format!("{at}.{name}"));
                    Self::collect(value, path, key, None, all);
                }
                return;
            }
            Value::Array(own) => {
                for (index, value) in own.iter().enumerate() {
                    let path = format!("{path}[{index}]");
                    Self::collect(value, path, key.clone(), item.or(Some(index)), all);
                }
                return;
            }
            Value::Float(number) => *number,
            Value::Integer(number) => *number as f64,
            _ => return,
        };
        let item = item.unwrap_or_default();
        all.push(Self {
            path,
            key,
            item,
            value: number,
        });
    }

    /// `open` is whether each end of the range is excluded.
    fn check(&self, range: Option<&Value>, open: [bool; 2], waiver: &str) -> Result<(), Error> {
        let Self {
            path, item, value, ..
        } = self;
        let wrong =
            |allowed: String| Err(Error(format!("{path}: got {value}, expected {allowed}")));
        if !value.is_finite() {
            return wrong("a finite number".into());
        }
        let ranges = range.and_then(Value::as_array);
        let of_items = ranges.filter(|ranges| ranges.iter().all(Value::is_array));
        let range = of_items.map_or(range, |ranges| ranges.get(*item));
        if let (Some(ranges), None) = (of_items, range) {
            return wrong(format!("a list of at most {}", ranges.len()));
        }
        let Some((low, high)) = range.and_then(|range| range.clone().try_into::<(f64, f64)>().ok())
        else {
            return Ok(());
        };
        let [is_above, is_below] = open;
        let is_at_open_end = is_above && *value <= low || is_below && *value >= high;
        if (low..=high).contains(value) && !is_at_open_end {
            return Ok(());
        }
        let least = if is_above { "above" } else { "at least" };
        let most = if is_below { "below" } else { "at most" };
        wrong(if high.is_infinite() {
            format!("{least} {low}{waiver}")
        } else if open == [false; 2] {
            format!("{low} to {high}{waiver}")
        } else {
            format!("{least} {low}, {most} {high}{waiver}")
        })
    }
}

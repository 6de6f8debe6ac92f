//! A valid input with something wrong.

use super::dice::Dice;
use serde_json::{Map, Value, json};

/// A file of JSON: one to four things changed in one of `seeds`, now and then its bytes, too.
pub fn mutated_json(dice: &mut Dice, seeds: &[Value]) -> Vec<u8> {
    let mut value: Value = dice.of(seeds).clone();
    for _ in 0..=dice.below(4) {
        mutate(dice, &mut value, seeds);
    }
    let bytes = if dice.one_in(2) {
        value.to_string()
    } else {
        serde_json::to_string_pretty(&value).unwrap()
    }
    .into_bytes();
    if dice.one_in(6) {
        mutated_bytes(dice, &bytes)
    } else {
        bytes
    }
}

/// Walks down to some place and changes it.
fn mutate(dice: &mut Dice, value: &mut Value, seeds: &[Value]) {
    // The deeper, the likelier: most of what a file means is in its leaves.
    let stay = dice.one_in(6);
    match value {
        Value::Object(map) if !map.is_empty() && !stay => {
            let key = map.keys().nth(dice.below(map.len())).unwrap().clone();
            mutate(dice, map.get_mut(&key).unwrap(), seeds);
        }
        Value::Array(all) if !all.is_empty() && !stay => {
            let i = dice.below(all.len());
            mutate(dice, &mut all[i], seeds);
        }
        Value::Object(map) => change_object(dice, map, seeds),
        Value::Array(all) => change_array(dice, all),
        Value::Number(number) if !dice.one_in(5) => {
            let x = number.as_f64().unwrap();
            let y = match dice.below(5) {
                0 => dice.number(),
                1 => -x,
                2 => x * 10.0_f64.powi(dice.below(25) as i32 - 12),
                3 => x + f64::EPSILON * x * (dice.below(5) as f64 - 2.0),
                _ => x * (dice.uniform() + 0.5),
            };
            *value = json!(y);
        }
        _ => *value = any_value(dice, seeds),
    }
}

fn change_object(dice: &mut Dice, map: &mut Map<String, Value>, seeds: &[Value]) {
    let key = |dice: &mut Dice, map: &Map<String, Value>| map.keys().nth(dice.below(map.len())).cloned();
    match dice.below(4) {
        0 => {
            if let Some(key) = key(dice, map) {
                map.remove(&key);
            }
        }
        1 => {
            if let Some(old) = key(dice, map) {
                let value = map.remove(&old).unwrap();
                let new = String::from_utf8_lossy(&mutated_bytes(dice, old.as_bytes())).into_owned();
                map.insert(new, value);
            }
        }
        // A part of another file, under its own name or under a name of this one.
        2 => {
            if let Some((name, part)) = part_of_any(dice, seeds) {
                let name = if dice.one_in(2) {
                    key(dice, map).unwrap_or(name)
                } else {
                    name
                };
                map.insert(name, part);
            }
        }
        _ => {
            if let Some(key) = key(dice, map) {
                map.insert(key, any_value(dice, seeds));
            }
        }
    }
}

fn part_of_any(dice: &mut Dice, seeds: &[Value]) -> Option<(String, Value)> {
    let seed = dice.of(seeds);
    any_part(dice, seed)
}

/// A key somewhere in `value`, with what it holds.
fn any_part(dice: &mut Dice, value: &Value) -> Option<(String, Value)> {
    let map = value.as_object().filter(|map| !map.is_empty())?;
    let (key, part) = map.iter().nth(dice.below(map.len()))?;
    if part.is_object() && dice.one_in(2) {
        return any_part(dice, part);
    }
    Some((key.clone(), part.clone()))
}

fn change_array(dice: &mut Dice, all: &mut Vec<Value>) {
    let i = dice.below(all.len());
    match dice.below(4) {
        0 if !all.is_empty() => {
            all.remove(i);
        }
        1 if !all.is_empty() => all.push(all[i].clone()),
        2 => all.reverse(),
        _ => all.clear(),
    }
}

fn any_value(dice: &mut Dice, seeds: &[Value]) -> Value {
    match dice.below(9) {
        0 => Value::Null,
        1 => json!(dice.one_in(2)),
        2 => json!(dice.number()),
        3 => json!(u64::MAX),
        4 => json!("NaN"),
        5 => json!([]),
        6 => json!({}),
        7 => json!([dice.number(), dice.number(), dice.number()]),
        _ => part_of_any(dice, seeds).map_or(Value::Null, |part| part.1),
    }
}

/// A table: one to five cells, columns or lines changed in one of `seeds`, now and then its bytes, too.
pub fn mutated_csv(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    let text = String::from_utf8_lossy(dice.of::<Vec<u8>>(seeds)).into_owned();
    let delimiter = if text.lines().any(|l| l.contains(';')) {
        ';'
    } else {
        ','
    };
    let mut table: Vec<Vec<String>> = text
        .lines()
        .map(|line| line.split(delimiter).map(str::to_owned).collect())
        .collect();
    // Some tables long, some short.
    let keep = 1 + dice.below(table.len());
    if dice.one_in(3) {
        table.truncate(keep);
    }
    for _ in 0..=dice.below(5) {
        change_table(dice, &mut table);
    }
    let delimiter = if dice.one_in(12) {
        "\t".to_owned()
    } else {
        delimiter.to_string()
    };
    let lines: Vec<String> = table.iter().map(|line| line.join(&delimiter)).collect();
    let bytes = lines
        .join(if dice.one_in(8) { "\r\n" } else { "\n" })
        .into_bytes();
    if dice.one_in(8) {
        mutated_bytes(dice, &bytes)
    } else {
        bytes
    }
}

fn change_table(dice: &mut Dice, table: &mut Vec<Vec<String>>) {
    if table.is_empty() {
        return;
    }
    let line = dice.below(table.len());
    let width = table[line].len();
    let column = dice.below(width);
    match dice.below(10) {
        0..=4 if width > 0 => table[line][column] = cell(dice, &table[line][column].clone()),
        // A whole column, below its name.
        5 => {
            let one = cell(dice, "1");
            let each = dice.one_in(2);
            for row in table.iter_mut().skip(1).filter(|row| row.len() > column) {
                row[column] = if each {
                    cell(dice, &row[column].clone())
                } else {
                    one.clone()
                };
            }
        }
        6 => {
            for row in table.iter_mut().filter(|row| row.len() > column) {
                row.remove(column);
            }
        }
        7 => {
            let copy = table[line].clone();
            for _ in 0..=dice.below(12) {
                table.push(copy.clone());
            }
        }
        8 => {
            table.remove(line);
        }
        _ => {
            // Two columns change places in one line only: the first, mostly, which swaps what they mean.
            let at = if dice.one_in(2) { 0 } else { line };
            let (a, b) = (dice.below(table[at].len()), dice.below(table[at].len()));
            if !table[at].is_empty() {
                table[at].swap(a, b);
            }
        }
    }
}

fn cell(dice: &mut Dice, was: &str) -> String {
    let number = was.replace(',', ".").parse::<f64>().ok();
    match (dice.below(8), number) {
        (0..=2, Some(x)) => match dice.below(4) {
            0 => (-x).to_string(),
            1 => (x * 10.0_f64.powi(dice.below(25) as i32 - 12)).to_string(),
            2 => "0".to_owned(),
            _ => (x * (1.0 + f64::EPSILON)).to_string(),
        },
        (3, _) => dice.number().to_string(),
        (4, _) => (*dice.of(&[
            "",
            "nan",
            "inf",
            "-inf",
            "null",
            "?",
            "1e999",
            "0x10",
            "\"",
            "\"a",
            "\u{2212}1",
            "1,5",
            "unknown",
        ]))
        .to_owned(),
        (5, _) => String::from_utf8_lossy(&mutated_bytes(dice, was.as_bytes())).into_owned(),
        (6, _) => format!("{:e}", dice.number()),
        _ => dice.number().to_string(),
    }
}

/// Bytes with one to eight places changed, cut, doubled or left out.
pub fn mutated_bytes(dice: &mut Dice, seed: &[u8]) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=dice.below(8) {
        let at = dice.below(bytes.len() + 1);
        let length = match dice.below(3) {
            0 => 1,
            1 => 1 + dice.below(16),
            _ => 1 + dice.below(1 + bytes.len() / 4),
        };
        let end = (at + length).min(bytes.len());
        match dice.below(8) {
            0 | 1 if at < bytes.len() => bytes[at] ^= 1 << dice.below(8),
            2 if at < bytes.len() => bytes[at] = *dice.of(&[0, 1, 0x7f, 0x80, 0xff, b'"', b',', b'-', b'9']),
            3 => bytes.truncate(at),
            4 => {
                bytes.drain(at..end);
            }
            5 => {
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            6 => bytes[at..end].fill(0),
            _ => {
                let noise: Vec<u8> = (0..length.min(64)).map(|_| dice.below(256) as u8).collect();
                bytes.splice(at..at, noise);
            }
        }
    }
    bytes
}

//! The keys that lead to a place in JSON.

/// The keys and numbers of lists, counted from 0, that lead to the value at a line and a column, both
/// counted from 1: `views, 0, source`. Nothing at the top. Where the place is a closing bracket, they
/// lead to what is in front of it if that is meant, and else to what it closes.
pub(super) fn keys(text: &str, line: usize, column: usize, in_front: bool) -> String {
    let before =
        text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum::<usize>();
    let end = (before + column).min(text.len());
    let mut way = Way::default();
    text.as_bytes()[..end].iter().for_each(|byte| way.pass(*byte));
    let left = way.left.filter(|(_, at)| in_front && *at == end);
    let steps = left.map_or(way.steps, |(steps, _)| steps);
    let names: Vec<String> = steps.into_iter().map(Step::name).filter(|s| !s.is_empty()).collect();
    names.join(", ")
}

#[derive(Debug, Clone)]
enum Step {
    Key(Vec<u8>),
    Number(usize),
}

impl Step {
    fn name(self) -> String {
        match self {
            Self::Key(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
            Self::Number(number) => number.to_string(),
        }
    }
}

/// Where a reader of JSON is.
#[derive(Debug, Default)]
struct Way {
    steps: Vec<Step>,
    /// The steps before the last bracket was closed, and how many bytes were read then.
    left: Option<(Vec<Step>, usize)>,
    read: usize,
    /// The last text, and whether it is still open or a sign in it is escaped.
    text: Vec<u8>,
    open: bool,
    escaped: bool,
}

impl Way {
    fn pass(&mut self, byte: u8) {
        self.read += 1;
        if self.open {
            return self.pass_text(byte);
        }
        match byte {
            b'"' => (self.open, self.text) = (true, Vec::new()),
            b'{' => self.steps.push(Step::Key(Vec::new())),
            b'[' => self.steps.push(Step::Number(0)),
            b'}' | b']' => {
                self.left = Some((self.steps.clone(), self.read));
                self.steps.pop();
            }
            b':' => {
                let key = std::mem::take(&mut self.text);
                if let Some(step) = self.steps.last_mut() {
                    *step = Step::Key(key);
                }
            }
            b',' => {
                if let Some(Step::Number(number)) = self.steps.last_mut() {
                    *number += 1;
                }
            }
            _ => {}
        }
    }

    fn pass_text(&mut self, byte: u8) {
        match byte {
            _ if self.escaped => self.escaped = false,
            b'\\' => self.escaped = true,
            b'"' => return self.open = false,
            _ => {}
        }
        self.text.push(byte);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_lead_to_a_value() {
        let text = "{\"a\": 1,\n \"views\": [{\"x\": 0}, {\"name, {\\\"\": \"]\", \"goal\": {\"p\": null}}]}";
        let keys_at = |word: &str, in_front: bool| {
            let before = &text[..text.find(word).unwrap() + word.len()];
            let line = before.matches('\n').count() + 1;
            keys(text, line, before.len() - before.rfind('\n').map_or(0, |n| n + 1), in_front)
        };
        let at = |word: &str| keys_at(word, true);
        assert_eq!(at("1"), "a");
        assert_eq!(at("0"), "views, 0, x");
        assert_eq!(at("null"), "views, 1, goal, p");
        assert_eq!(at("null}"), "views, 1, goal, p");
        assert_eq!(keys_at("null}", false), "views, 1, goal", "what lacks a key");
        assert_eq!(keys(text, 1, 1, true), "");
        assert_eq!(keys("", 3, 7, true), "");
    }
}

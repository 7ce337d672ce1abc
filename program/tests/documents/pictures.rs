//! The pictures of the pages are those that the program draws: docs/draw.sh, which draws them, is read, and what
//! takes little time is drawn anew.

use leafdyn_testing::root;
use leafdyn_testing::workplace::Workplace;
use std::fs;
use std::io::Cursor;

/// Those that are drawn in two seconds or less.
const CHEAP: [&str; 5] = [
    "fig04.svg",
    "trace_fig10.svg",
    "undulation.svg",
    "undulating-leaf.png",
    "palm.svg",
];

/// Numbers of a drawing may differ by so many pixels and by this part: processors differ in the last digits of
/// elementary functions.
const PIXELS: f64 = 0.3;
const PART: f64 = 1e-3;

/// Colors, from 0 to 255, of this part of the pixels may differ by more than the others do.
const COLORS: u8 = 4;
const OTHER_PIXELS: f64 = 2e-3;

/// What docs/draw.sh makes of a page's picture.
struct Drawn {
    arguments: String,
    /// The file that is copied, and its name in docs.
    file: String,
    picture: String,
}

/// The pictures of docs/draw.sh, each with the command before it.
fn drawn() -> Vec<Drawn> {
    let script = fs::read_to_string(root().join("docs/draw.sh")).unwrap();
    let script = script.replace("\\\n", " ");
    let (mut arguments, mut all) = (String::new(), Vec::new());
    for line in script.lines().map(str::trim) {
        if let Some(command) = line.strip_prefix("leafdyn ") {
            arguments = command.replace('\'', "");
        }
        let copied = line.strip_prefix("cp ").and_then(|it| it.split_once(' '));
        let Some((file, to)) = copied else { continue };
        let picture = to.trim_matches('"').strip_prefix("$top/docs/").unwrap();
        all.push(Drawn {
            arguments: arguments.clone(),
            file: file.trim_matches('"').into(),
            picture: picture.into(),
        });
    }
    all
}

/// A text's words between its numbers, and these.
fn words_and_numbers(text: &str) -> (String, Vec<f64>) {
    let (mut words, mut numbers, mut number) = (String::new(), Vec::new(), String::new());
    for letter in text.chars().chain([' ']) {
        let goes_on = letter.is_ascii_digit()
            || letter == '.' && !number.is_empty()
            || letter == '-' && number.is_empty();
        if goes_on {
            number.push(letter);
            continue;
        }
        match number.parse::<f64>() {
            Ok(known) => {
                numbers.push(known);
                words.push('#');
            }
            Err(_) => words.push_str(&number),
        }
        number.clear();
        words.push(letter);
    }
    (words, numbers)
}

/// What differs between two drawings, if anything does.
fn difference_of_drawings(kept: &str, now: &str) -> Option<String> {
    let [kept, now] = [kept, now].map(words_and_numbers);
    if kept.0 != now.0 {
        let same = kept
            .0
            .chars()
            .zip(now.0.chars())
            .take_while(|(a, b)| a == b);
        let at = same.count().saturating_sub(30);
        let there = |words: &str| words.chars().skip(at).take(90).collect::<String>();
        return Some(format!("{} -> {}", there(&kept.0), there(&now.0)));
    }
    let mut both = kept.1.iter().zip(&now.1);
    let apart = both.find(|(a, b)| (*a - *b).abs() > PIXELS + PART * a.abs());
    apart.map(|(a, b)| format!("{a} -> {b}"))
}

/// The size of a picture, and its bytes of color.
fn pixels(png: &[u8]) -> ((u32, u32), Vec<u8>) {
    let mut reader = png::Decoder::new(Cursor::new(png)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let frame = reader.next_frame(&mut bytes).unwrap();
    bytes.truncate(frame.buffer_size());
    ((frame.width, frame.height), bytes)
}

/// What differs between two pictures, if more than a little does.
fn difference_of_pixels(kept: &[u8], now: &[u8]) -> Option<String> {
    let [(size, kept), (new_size, now)] = [kept, now].map(pixels);
    if size != new_size || kept.len() != now.len() {
        return Some(format!("{size:?} -> {new_size:?}"));
    }
    let others = (kept.iter().zip(&now)).filter(|(a, b)| a.abs_diff(**b) > COLORS);
    let part = others.count() as f64 / kept.len() as f64;
    (part > OTHER_PIXELS).then(|| format!("{part:.4} of the colors differ"))
}

#[test]
fn pictures_of_the_pages_are_those_that_are_drawn_today() {
    let all = drawn();
    for name in CHEAP {
        let Drawn {
            arguments, file, ..
        } = all.iter().find(|it| it.picture == name).unwrap();
        let place = Workplace::empty();
        place.run(arguments).ends(0);
        let kept = fs::read(root().join("docs").join(name)).unwrap();
        let now = fs::read(place.path(file)).unwrap();
        let difference = match name.ends_with(".png") {
            true => difference_of_pixels(&kept, &now),
            false => difference_of_drawings(
                &String::from_utf8(kept).unwrap(),
                &String::from_utf8(now).unwrap(),
            ),
        };
        if let Some(difference) = difference {
            panic!("docs/{name}: {difference}: leafdyn {arguments}; cp {file} docs/{name}");
        }
    }
}

#[test]
fn drawings_differ_by_words_and_by_numbers() {
    let kept = r#"<path d="M 12.34 -5"/><text>2.5×10⁻³ cm</text>"#;
    let same = |other: &str| difference_of_drawings(kept, &kept.replace("12.34", other)).is_none();
    assert!(same("12.34") && same("12.5") && !same("12.7") && !same("L 12.34"));
    let other_words = kept.replace("cm", "mm");
    assert!(difference_of_drawings(kept, &other_words).is_some());
}

/// Every picture that is copied is there, and those drawn by others are named.
#[test]
fn every_drawing_of_the_pages_has_its_command() {
    let all = drawn();
    let loops = |picture: &str| picture.contains('$');
    for picture in all.iter().map(|it| &it.picture).filter(|it| !loops(it)) {
        assert!(root().join("docs").join(picture).exists(), "{picture}");
    }
    let measured = fs::read_to_string(root().join("benches/measure.sh")).unwrap();
    for entry in fs::read_dir(root().join("docs")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let is_picture = [".svg", ".png", ".gif"]
            .iter()
            .any(|end| name.ends_with(end));
        let known = all.iter().any(|it| it.picture == name)
            || measured.contains(&format!("docs/{name}"))
            // A browser's.
            || name == "live.png";
        assert!(!is_picture || known, "{name}: no script draws it");
    }
}

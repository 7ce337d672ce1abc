//! Answers questions, one a line, as the solver in a page does: to compare both.

use leafdyn_web::session::Session;
use std::io::{BufRead, Write};

fn main() -> std::io::Result<()> {
    let (mut session, mut out) = (Session::default(), std::io::stdout().lock());
    for question in std::io::stdin().lock().lines() {
        out.write_all(&session.answer(question?.as_bytes()))?;
        out.write_all(b"\n")?;
        out.flush()?;
    }
    Ok(())
}

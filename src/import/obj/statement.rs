//! Texture statements of MTL files: options, then the picture's name.

use crate::scene::{TextureRef, Wrap};
use glam::{Affine2, Vec2};

/// A texture statement.
pub(super) struct Statement<'a> {
    /// The picture's name.
    pub file: &'a str,
    /// Where the picture lies.
    pub transform: Affine2,
    /// What is beside it.
    pub wrap: Wrap,
    /// How strongly bumps are seen.
    pub bump: f32,
    /// Options that are not read.
    pub left_out: Vec<&'a str>,
}

impl<'a> Statement<'a> {
    pub fn of(text: &'a str) -> Self {
        let (mut rest, mut bump, mut wrap, mut left_out) = (text.trim(), 1.0, Wrap::Repeat, Vec::new());
        let (mut scale, mut offset) = (Vec2::ONE, Vec2::ZERO);
        // The last word is the picture's, whatever it looks like.
        while let Some((option, after)) = split(rest) {
            let most = match option {
                "-s" | "-o" | "-t" => 3,
                "-mm" => 2,
                "-bm" | "-boost" | "-texres" => 1,
                "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-type" => 0,
                _ => break,
            };
            rest = after;
            if most == 0 {
                let Some((value, after)) = split(rest) else { break };
                rest = after;
                match (option, value) {
                    ("-clamp", "on") => wrap = Wrap::Clamp,
                    ("-imfchan", _) => left_out.push(option),
                    _ => {}
                }
                continue;
            }
            let mut values: Vec<f32> = Vec::new();
            while values.len() < most
                && let Some((word, after)) = split(rest)
                && let Ok(value) = word.parse()
            {
                values.push(value);
                rest = after;
            }
            let value =
                |i: usize, default| values.get(i).copied().filter(|v| v.is_finite()).unwrap_or(default);
            match option {
                "-s" => scale = Vec2::new(value(0, 1.0), value(1, 1.0)),
                "-o" => offset = Vec2::new(value(0, 0.0), value(1, 0.0)),
                "-bm" => bump = value(0, 1.0),
                "-mm" if (value(0, 0.0), value(1, 1.0)) != (0.0, 1.0) => left_out.push(option),
                "-t" if values.iter().any(|v| *v != 0.0) => left_out.push(option),
                _ => {}
            }
        }
        // v grows upwards in OBJ, and downwards in the scene.
        let down = Vec2::new(offset.x, 1.0 - scale.y - offset.y);
        let transform = Affine2::from_scale_angle_translation(scale, 0.0, down);
        Self { file: rest, transform, wrap, bump, left_out }
    }

    /// The use of `image`, this statement's.
    pub fn texture(&self, image: usize) -> TextureRef {
        let Self { transform, wrap, .. } = *self;
        TextureRef { image, uv_set: 0, transform, wrap_u: wrap, wrap_v: wrap, nearest: false }
    }
}

/// The first word and what follows it; none for the last.
fn split(text: &str) -> Option<(&str, &str)> {
    text.split_once(char::is_whitespace).map(|(word, rest)| (word, rest.trim_start()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_stand_before_a_name_that_may_have_spaces() {
        let s = Statement::of("-blendu on -s 2 3 -o 0.25 0.5 0 -clamp on -bm 0.5 -mm 0 1 old wood.png");
        assert_eq!((s.file, s.wrap, s.bump), ("old wood.png", Wrap::Clamp, 0.5));
        assert!(s.left_out.is_empty());
        // The lower left corner: 0 0 in OBJ, 0 1 here.
        assert_eq!(s.transform.transform_point2(Vec2::new(0.0, 1.0)), Vec2::new(0.25, 0.5));
        assert_eq!(s.transform.transform_point2(Vec2::new(1.0, 0.0)), Vec2::new(2.25, -2.5));
        let s = Statement::of("-s 2 -mm 0.5 1 -t 0 0 1 -imfchan m -odd.png");
        assert_eq!((s.file, s.left_out), ("-odd.png", vec!["-mm", "-t", "-imfchan"]));
        assert_eq!(Statement::of("-s").file, "-s");
    }
}

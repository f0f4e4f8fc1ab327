//! A Nuke script: the sequence, and over it the class of each pixel in colour.

use super::Review;
use crate::measure::picture::CLASS_COLORS;

impl Review<'_> {
    /// The script, with the frames in folder `base` (relative to the script, or absolute).
    pub(super) fn nuke_script(&self, base: &str, first: i64, last: i64) -> String {
        let (prefix, suffix, digits) = self.names.parts();
        let folder = if base.starts_with("..") {
            format!("\\[file dirname \\[value root.name]]/{base}")
        } else {
            quoted(base)
        };
        let file = format!("{folder}{}%0{digits}d{}", quoted(prefix), quoted(suffix));
        // There is no way to quote it.
        let label = match file.contains('#') {
            true => {
                " label \"Nuke takes # for the frame's number: rename the folders or frames (--name) that have one\"\n"
            }
            false => "",
        };
        let (width, height, aspect, fps) = (self.width, self.height, self.pixel_aspect, self.fps.value());
        let mut script = format!(
            "Root {{\n inputs 0\n first_frame {first}\n last_frame {last}\n fps {fps}\n \
             format \"{width} {height} 0 0 {width} {height} {aspect} Buzz\"\n}}\n\
             Read {{\n inputs 0\n file \"{file}\"\n first {first}\n last {last}\n origfirst {first}\n origlast {last}\n \
             origset true\n name Beauty\n{label} xpos 0\n ypos 0\n}}\n"
        );
        if self.has_class {
            let [red, green, blue] = [0, 1, 2].map(expression);
            script = format!(
                "add_layer {{pixelClass pixelClass.id}}\n{script}set Beauty [stack 0]\n\
                 Expression {{\n expr0 \"{red}\"\n expr1 \"{green}\"\n expr2 \"{blue}\"\n expr3 1\n name ClassColours\n \
                 label \"red missed, orange bad, yellow creeping, purple entering, green edge, pink moved; blue reused\"\n \
                 xpos 160\n ypos 80\n}}\n\
                 push $Beauty\n\
                 Merge2 {{\n inputs 2\n operation over\n mix 0.5\n name ClassOverlay\n \
                 label \"mix is the overlay's strength\"\n xpos 0\n ypos 160\n}}\n"
            );
        }
        script
            + &format!(
                "Viewer {{\n frame_range {first}-{last}\n fps {fps}\n name Viewer1\n xpos 0\n ypos 240\n}}\n"
            )
    }
}

/// The linear colour of a class, channel number `channel`, as Nuke computes it: the last class needs no question.
fn expression(channel: usize) -> String {
    let linear = |color: &[u8; 3]| {
        let v = f64::from(color[channel]) / 255.0;
        if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    };
    let (last, others) = (CLASS_COLORS.len() - 1, &CLASS_COLORS[..CLASS_COLORS.len() - 1]);
    let asked: String = others
        .iter()
        .enumerate()
        .map(|(i, color)| format!("pixelClass.id=={i}?{:.4}:", linear(color)))
        .collect();
    format!("{asked}{:.4}", linear(&CLASS_COLORS[last]))
}

/// Text inside quotes, where Tcl would see commands, variables and frame numbers.
fn quoted(text: &str) -> String {
    let special = |c: char| matches!(c, '[' | ']' | '$' | '"' | '\\' | '{' | '}');
    text.chars().fold(String::new(), |mut quoted, c| {
        if special(c) {
            quoted.push('\\');
        }
        if c == '%' {
            quoted.push('%');
        }
        quoted.push(c);
        quoted
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_quoted_for_tcl() {
        assert_eq!(quoted("a[1] $x 50%"), "a\\[1\\] \\$x 50%%");
    }

    #[test]
    fn each_class_has_its_colour() {
        let red = expression(0);
        assert!(red.starts_with("pixelClass.id==0?0.3050:pixelClass.id==1?0.0091:"), "{red}");
        assert_eq!(red.matches('?').count(), 9);
        assert!(red.ends_with(":0.0612"), "{red}");
    }
}

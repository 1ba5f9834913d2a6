//! Plans whose kernels begin with garbage in every field that they do not load.

use kernelgen::plan::Plan;
use std::collections::BTreeMap;

/// Fills the records of kernels, and those that stream consumers take out, with what is no number before anything is loaded. The
/// language would fill them with zeros, which hides a load that is missing.
pub fn poison(plan: &mut Plan) {
    for kernel in &mut plan.kernels {
        kernel.module = poisoned(&kernel.module);
    }
}

/// Takes a load out of all kernels: lines that begin so, `eye.throughput = bitcast`.
pub fn forget(plan: &mut Plan, load: &str) {
    for kernel in &mut plan.kernels {
        let kept = kernel.module.lines().filter(|line| !line.trim_start().starts_with(load));
        kernel.module = kept.map(|line| format!("{line}\n")).collect();
    }
}

fn poisoned(module: &str) -> String {
    let structs = structs(module);
    let mut text = String::new();
    let mut generated = false;
    for line in module.lines() {
        text.push_str(line);
        text.push('\n');
        if let Some(rest) = line.strip_prefix("fn ") {
            let name = rest.split('(').next().unwrap_or_default();
            generated = name.ends_with("_main") || name.starts_with("load_");
        }
        if let Some((name, fields)) = declared(line, &structs).filter(|_| generated) {
            for (field, ty) in fields {
                push_garbage(&mut text, &format!("{name}.{field}"), ty, &structs);
            }
        }
    }
    text
}

type Structs<'a> = BTreeMap<&'a str, Vec<(&'a str, &'a str)>>;

/// `var eye: Walk;` of a struct of the module.
fn declared<'a>(line: &'a str, structs: &'a Structs<'a>) -> Option<(&'a str, &'a [(&'a str, &'a str)])> {
    let (name, ty) = line.trim().strip_prefix("var ")?.strip_suffix(';')?.split_once(": ")?;
    Some((name, structs.get(ty)?))
}

/// Names and types of the members of each struct.
fn structs(module: &str) -> Structs<'_> {
    let mut structs = Structs::new();
    let mut open = None;
    for line in module.lines() {
        if let Some(name) = line.strip_prefix("struct ").and_then(|rest| rest.split_whitespace().next()) {
            structs.insert(name, Vec::new());
            open = Some(name);
        } else if line.starts_with('}') {
            open = None;
        } else if let Some(fields) = open.and_then(|name| structs.get_mut(name))
            && let Some((field, ty)) = line.trim().strip_suffix(',').and_then(|line| line.split_once(": "))
        {
            fields.push((field, ty));
        }
    }
    structs
}

fn push_garbage(text: &mut String, place: &str, ty: &str, structs: &Structs<'_>) {
    let garbage = match ty {
        "u32" => "0xdeadbeefu".to_owned(),
        "real" => "bitcast<f32>(0x7fc0beefu)".to_owned(),
        "vec2r" | "vec3r" => format!("vec{}f(bitcast<f32>(0x7fc0beefu))", &ty[3..4]),
        _ => {
            for (field, ty) in structs.get(ty).into_iter().flatten() {
                push_garbage(text, &format!("{place}.{field}"), ty, structs);
            }
            return;
        }
    };
    text.push_str(&format!("        {place} = {garbage};\n"));
}

#[cfg(test)]
mod tests {
    use super::poisoned;

    #[test]
    fn records_of_generated_functions_begin_with_garbage() {
        let module = "struct Hit {\n    /// Primitive.\n    prim: u32,\n}\n\nstruct Walk {\n    hit: Hit,\n    pdf: real,\n}\n\n\
                      fn helper() {\n    var walk: Walk;\n}\n\nfn trace_main(\n    lane: u32,\n) {\n        var eye: Walk;\n}\n";
        let garbage = "        var eye: Walk;\n        eye.hit.prim = 0xdeadbeefu;\n        \
                       eye.pdf = bitcast<f32>(0x7fc0beefu);\n}\n";
        assert!(poisoned(module).ends_with(garbage));
        assert!(poisoned(module).contains("    var walk: Walk;\n}\n"), "stages keep their zeros");
    }
}

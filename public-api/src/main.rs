//! Prints the library's public interface as Rust code without bodies. If the listing changes, the interface changes.
//!
//!     public-api SRC/LIB.RS [CRATE/SRC/LIB.RS...]
//!
//! It lists what the first crate passes on with `pub use`, wherever it or one of the other crates defines it, but for what is
//! `#[doc(hidden)]`. The listing is made from the source, so it is the same with every compiler and needs no build. Not
//! included: code that `build.rs` writes, and names that a macro makes, but for the settings.

use std::collections::BTreeMap;
use std::path::Path;
use std::{env, fs};

use proc_macro2::{Delimiter, TokenTree};
use syn::{
    Attribute, Fields, FieldsNamed, FieldsUnnamed, File, ImplItem, Item, ItemImpl, ItemMod, TraitItem, Type,
    UseTree, Visibility,
};

/// An item that is no module, and the path of its module.
type Placed = (Vec<String>, Item);

fn main() {
    let roots: Vec<String> = env::args().skip(1).collect();
    let (first, others) = roots.split_first().expect("usage: public-api SRC/LIB.RS [CRATE/SRC/LIB.RS...]");
    let mut crates: BTreeMap<String, Vec<Placed>> =
        others.iter().map(|root| (name(root), items(root))).collect();
    crates.insert("crate".into(), items(first));
    let mut passed_on = vec![];
    for (_, item) in crates["crate"].iter().filter(|(module, _)| module.is_empty()) {
        if let Item::Use(u) = item
            && public(&u.vis)
            && !hidden(&u.attrs)
        {
            leaves(&u.tree, &mut vec![], &mut passed_on);
        }
    }
    let mut listing: Vec<&Item> = vec![];
    // A single name is a crate of others.
    for path in passed_on.into_iter().filter(|path| path.len() > 1) {
        assert_ne!(path.last().map(String::as_str), Some("*"), "names are passed on one by one, as they are");
        let is_other = crates.contains_key(&path[0]);
        let (of, path) =
            if is_other { (&crates[&path[0]], &path[1..]) } else { (&crates["crate"], &path[..]) };
        for item in found(of, path) {
            // A module may have brought it already.
            if !listing.iter().any(|known| std::ptr::eq(*known, item)) {
                listing.push(item);
            }
        }
    }
    let mut listing: Vec<Item> = listing.into_iter().cloned().collect();
    keep(&mut listing);
    print!("{}", prettyplease::unparse(&File { shebang: None, attrs: vec![], items: listing }));
}

/// The name of a crate in paths: `crates/gpu/src/lib.rs` is `thirdbounce_gpu`.
fn name(root: &str) -> String {
    let folder = Path::new(root).ancestors().nth(2).and_then(Path::file_name).expect("CRATE/SRC/LIB.RS");
    format!("thirdbounce_{}", folder.to_string_lossy())
}

/// All items of a crate.
fn items(root: &str) -> Vec<Placed> {
    let root = Path::new(root);
    let mut file = parse(root);
    load(&mut file.items, root.parent().expect("a folder"));
    let mut all = vec![];
    flatten(file.items, &[], &mut all);
    all
}

fn flatten(items: Vec<Item>, module: &[String], into: &mut Vec<Placed>) {
    for item in items {
        match item {
            Item::Mod(m) if tests(&m.attrs) => {}
            Item::Mod(m) => {
                let inner = [module, &[m.ident.to_string()]].concat();
                flatten(m.content.map_or(vec![], |c| c.1), &inner, into);
            }
            Item::Macro(m) => into.extend(declared(&m).into_iter().map(|item| (module.to_vec(), item))),
            item => into.push((module.to_vec(), item)),
        }
    }
}

/// The settings that the macros `settings!`, `options!` and `solvers!` declare, as structs and an enum.
fn declared(of: &syn::ItemMacro) -> Vec<Item> {
    let tokens: Vec<TokenTree> = of.mac.tokens.clone().into_iter().collect();
    let named = |text: String| syn::parse_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    match of.mac.path.segments.last().map(|s| s.ident.to_string()).as_deref() {
        Some("settings") if matches!(tokens.first(), Some(TokenTree::Literal(_))) => {
            vec![named(format!("pub struct Settings {{ {} pub method: Method }}", fields(&tokens)))]
        }
        Some("options") => {
            let name = tokens.iter().zip(tokens.iter().skip(1)).find_map(|(at, name)| match (at, name) {
                (TokenTree::Punct(p), TokenTree::Ident(name)) if p.as_char() == ':' => Some(name),
                _ => None,
            });
            vec![named(format!("pub struct {} {{ {} }}", name.expect("the settings"), fields(&tokens)))]
        }
        Some("solvers") => {
            let groups = tokens.iter().filter_map(inner).flat_map(|group| {
                let pairs = group.windows(2).filter_map(|pair| match pair {
                    [TokenTree::Ident(name), TokenTree::Group(types)] => {
                        types.stream().into_iter().nth(2).map(|settings| format!("{name}({settings})"))
                    }
                    _ => None,
                });
                pairs.collect::<Vec<_>>()
            });
            vec![named(format!("pub enum Method {{ {} }}", groups.collect::<Vec<_>>().join(", ")))]
        }
        _ => vec![],
    }
}

/// The tokens inside braces.
fn inner(token: &TokenTree) -> Option<Vec<TokenTree>> {
    match token {
        TokenTree::Group(g) if g.delimiter() == Delimiter::Brace => Some(g.stream().into_iter().collect()),
        _ => None,
    }
}

/// The fields `name: Type = ...`, each optional, and `name: Options / Settings` of a declaration.
fn fields(tokens: &[TokenTree]) -> String {
    let is = |token: Option<&TokenTree>, c| matches!(token, Some(TokenTree::Punct(p)) if p.as_char() == c);
    let mut text = String::new();
    for (at, token) in tokens.iter().enumerate() {
        text += &inner(token).map_or_else(String::new, |inside| fields(&inside));
        // The key of an option may differ from its field: `grow as "support": bool`.
        let colon = if matches!(tokens.get(at + 1), Some(TokenTree::Ident(i)) if i == "as") {
            at + 3
        } else {
            at + 1
        };
        let (TokenTree::Ident(name), true) = (token, is(tokens.get(colon), ':')) else { continue };
        if is(tokens.get(colon + 1), ':') || is(tokens.get(at.wrapping_sub(1)), ':') {
            continue;
        }
        let rest = &tokens[colon + 1..];
        let end = rest.iter().position(|t| is(Some(t), '=') || is(Some(t), '/'));
        let Some(end) = end else { continue };
        let of = rest[..end].iter().map(ToString::to_string).collect::<String>();
        text += &match is(rest.get(end), '/') {
            true => format!("pub {name}: {}, ", rest[end + 1]),
            false => match of.strip_prefix("Option<") {
                Some(_) => format!("pub {name}: {of}, "),
                None => format!("pub {name}: Option<{of}>, "),
            },
        };
    }
    text
}

/// The paths that a `use` names; `*` for one that names none, or renames.
fn leaves(tree: &UseTree, before: &mut Vec<String>, into: &mut Vec<Vec<String>>) {
    match tree {
        UseTree::Path(path) => {
            before.push(path.ident.to_string());
            leaves(&path.tree, before, into);
            before.pop();
        }
        UseTree::Group(group) => group.items.iter().for_each(|t| leaves(t, before, into)),
        UseTree::Name(name) if name.ident == "self" => into.push(before.clone()),
        UseTree::Name(name) => into.push([&before[..], &[name.ident.to_string()]].concat()),
        UseTree::Rename(_) | UseTree::Glob(_) => into.push(vec!["*".into()]),
    }
}

/// What a path names: a module's items, or an item with its implementations.
fn found<'a>(of: &'a [Placed], path: &[String]) -> Vec<&'a Item> {
    let (name, module) = path.split_last().expect("a path");
    let whole: Vec<_> = of.iter().filter(|(m, _)| m == path).map(|(_, item)| item).collect();
    if !whole.is_empty() {
        return whole;
    }
    let defined = |(_, item): &&Placed| ident(item).is_some_and(|i| i == name);
    let all: Vec<_> = of.iter().filter(defined).collect();
    let module = passed_on_from(of, module, name);
    let below: Vec<_> = all.iter().filter(|(m, _)| m.starts_with(&module)).collect();
    let [(place, item)] = below[..] else { panic!("{} items are called {}", below.len(), path.join("::")) };
    // Where others have the name, too, implementations stand beside it.
    let near = |m: &[String]| all.len() == 1 || m.starts_with(place);
    let implementations =
        of.iter().filter(|(m, item)| near(m) && implements(item).is_some_and(|i| i == *name));
    [item].into_iter().chain(implementations.map(|(_, item)| item)).collect()
}

/// The module from which `module` passes on `name`, else `module` itself.
fn passed_on_from(of: &[Placed], module: &[String], name: &str) -> Vec<String> {
    let mut all = vec![];
    for (_, item) in of.iter().filter(|(m, _)| m == module) {
        if let Item::Use(u) = item
            && public(&u.vis)
        {
            leaves(&u.tree, &mut vec![], &mut all);
        }
    }
    let Some((_, path)) = all.iter().filter_map(|p| p.split_last()).find(|(last, _)| *last == name) else {
        return module.to_vec();
    };
    let mut from = module.to_vec();
    for part in path {
        match part.as_str() {
            "super" => drop(from.pop()),
            "crate" => from.clear(),
            "self" => {}
            _ => from.push(part.clone()),
        }
    }
    from
}

/// The name that an item defines.
fn ident(item: &Item) -> Option<&syn::Ident> {
    match item {
        Item::Fn(f) => Some(&f.sig.ident),
        Item::Struct(s) => Some(&s.ident),
        Item::Enum(e) => Some(&e.ident),
        Item::Trait(t) => Some(&t.ident),
        Item::Type(t) => Some(&t.ident),
        Item::Const(c) => Some(&c.ident),
        _ => None,
    }
}

/// The type that an item implements something for.
fn implements(item: &Item) -> Option<String> {
    match item {
        Item::Impl(ItemImpl { self_ty, .. }) => match &**self_ty {
            Type::Path(path) => path.path.segments.last().map(|s| s.ident.to_string()),
            _ => None,
        },
        _ => None,
    }
}

fn parse(file: &Path) -> File {
    let text = fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}

/// Inserts the items of modules that have files of their own.
fn load(items: &mut [Item], folder: &Path) {
    for item in items {
        let Item::Mod(ItemMod { attrs, ident, content, .. }) = item else { continue };
        if tests(attrs) {
            continue;
        }
        let inside = folder.join(ident.to_string());
        let places = [inside.join("mod.rs"), inside.with_extension("rs")];
        if content.is_none()
            && let Some(file) = places.iter().find(|p| p.exists())
        {
            *content = Some((Default::default(), parse(file).items));
        }
        if let Some((_, items)) = content {
            load(items, &inside);
        }
    }
}

fn tests(attrs: &[Attribute]) -> bool {
    attrs.iter().any(|a| a.path().is_ident("cfg") && a.parse_args::<syn::Ident>().is_ok_and(|i| i == "test"))
}

fn hidden(attrs: &[Attribute]) -> bool {
    attrs
        .iter()
        .any(|a| a.path().is_ident("doc") && a.parse_args::<syn::Ident>().is_ok_and(|i| i == "hidden"))
}

fn public(vis: &Visibility) -> bool {
    matches!(vis, Visibility::Public(_))
}

/// Keeps public items, without bodies.
fn keep(items: &mut Vec<Item>) {
    items.retain_mut(|item| match item {
        Item::Fn(f) => {
            f.block.stmts.clear();
            shows(&mut f.attrs, &f.vis)
        }
        Item::Struct(s) => {
            let whole = s.fields.len();
            let (Fields::Named(FieldsNamed { named: fields, .. })
            | Fields::Unnamed(FieldsUnnamed { unnamed: fields, .. })) = &mut s.fields
            else {
                return false;
            };
            let shown = |f: &syn::Field| public(&f.vis) && !hidden(&f.attrs);
            *fields = std::mem::take(fields).into_iter().filter(shown).collect();
            let shown = shows(&mut s.attrs, &s.vis);
            // Code that builds the struct needs more than the fields that show.
            if s.fields.len() < whole {
                s.attrs.push(syn::parse_quote!(#[private_fields]));
            }
            s.fields.iter_mut().for_each(|f| bare(&mut f.attrs));
            shown
        }
        Item::Enum(e) => {
            for variant in &mut e.variants {
                bare(&mut variant.attrs);
                variant.fields.iter_mut().for_each(|f| bare(&mut f.attrs));
            }
            shows(&mut e.attrs, &e.vis)
        }
        Item::Trait(t) => {
            for item in &mut t.items {
                if let TraitItem::Fn(f) = item {
                    bare(&mut f.attrs);
                    f.default.iter_mut().for_each(|block| block.stmts.clear());
                }
            }
            shows(&mut t.attrs, &t.vis)
        }
        Item::Const(c) => shows(&mut c.attrs, &c.vis),
        Item::Type(t) => shows(&mut t.attrs, &t.vis),
        Item::Impl(i) => keep_public(i),
        _ => false,
    });
}

/// Whether an item shows. Its attributes become those of the interface.
fn shows(attrs: &mut Vec<Attribute>, vis: &Visibility) -> bool {
    let shown = public(vis) && !hidden(attrs);
    bare(attrs);
    shown
}

/// Keeps the attributes that belong to the interface.
fn bare(attrs: &mut Vec<Attribute>) {
    attrs.retain(|a| ["derive", "non_exhaustive", "cfg"].iter().any(|name| a.path().is_ident(name)));
}

/// Keeps the public items of an implementation; if it implements a trait, its types and macros. Returns whether to keep
/// the implementation.
fn keep_public(block: &mut ItemImpl) -> bool {
    let shown = !hidden(&block.attrs);
    bare(&mut block.attrs);
    let of_trait = block.trait_.is_some();
    block.items.retain_mut(|item| match item {
        ImplItem::Fn(f) => {
            f.block.stmts.clear();
            shows(&mut f.attrs, &f.vis) && !of_trait
        }
        ImplItem::Const(c) => shows(&mut c.attrs, &c.vis) && !of_trait,
        ImplItem::Type(_) => true,
        ImplItem::Macro(_) => true,
        _ => false,
    });
    shown && (of_trait || !block.items.is_empty())
}

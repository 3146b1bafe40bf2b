//! Prints the library's public interface as Rust code without bodies. If the listing changes, the interface changes.
//!
//! The listing is made from the source, so it is the same with every compiler and needs no build. In a private module,
//! an item counts if some `pub use` names it. Not included: code that `build.rs` writes, and names that a macro makes.

use std::collections::BTreeSet;
use std::path::Path;
use std::{env, fs};

use syn::visit::Visit;
use syn::{Attribute, Fields, File, ImplItem, Item, ItemImpl, ItemMod, TraitItem, Type, UseTree, Visibility};

fn main() {
    for root in env::args().skip(1) {
        println!("// {root}\n");
        list(Path::new(&root));
    }
}

fn list(root: &Path) {
    let mut file = parse(root);
    load(&mut file.items, root.parent().expect("a folder"));
    let mut named = Named::default();
    named.visit_file(&file);
    let mut types = BTreeSet::new();
    keep(&mut file.items, true, &named.0);
    types_of(&file.items, &mut types);
    keep_impls(&mut file.items, &types);
    file.attrs.clear();
    print!("{}", prettyplease::unparse(&file));
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

/// The names that `pub use` exports.
#[derive(Default)]
struct Named(BTreeSet<String>);

impl<'ast> Visit<'ast> for Named {
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if public(&item.vis) {
            self.tree(&item.tree);
        }
    }
}

impl Named {
    fn tree(&mut self, tree: &UseTree) {
        match tree {
            UseTree::Path(path) => self.tree(&path.tree),
            UseTree::Group(group) => group.items.iter().for_each(|t| self.tree(t)),
            UseTree::Name(name) => drop(self.0.insert(name.ident.to_string())),
            UseTree::Rename(name) => drop(self.0.insert(name.ident.to_string())),
            UseTree::Glob(_) => {}
        }
    }
}

fn public(vis: &Visibility) -> bool {
    matches!(vis, Visibility::Public(_))
}

/// Keeps public items. In a private module (`open` is false), keeps those among `named`.
fn keep(items: &mut Vec<Item>, open: bool, named: &BTreeSet<String>) {
    let counts =
        |vis: &Visibility, name: &syn::Ident| public(vis) && (open || named.contains(&name.to_string()));
    items.retain_mut(|item| match item {
        Item::Mod(m) => {
            let open = open && public(&m.vis);
            bare(&mut m.attrs);
            match &mut m.content {
                Some((_, items)) if !tests(&m.attrs) => {
                    keep(items, open, named);
                    !items.is_empty()
                }
                _ => false,
            }
        }
        Item::Fn(f) => {
            bare(&mut f.attrs);
            f.block.stmts.clear();
            counts(&f.vis, &f.sig.ident)
        }
        Item::Struct(s) => {
            bare(&mut s.attrs);
            let whole = s.fields.len();
            if let Fields::Named(fields) = &mut s.fields {
                fields.named =
                    std::mem::take(&mut fields.named).into_iter().filter(|f| public(&f.vis)).collect();
            }
            // The first private field breaks code that builds the struct from its fields.
            if s.fields.len() < whole {
                s.attrs.push(syn::parse_quote!(#[private_fields]));
            }
            s.fields.iter_mut().for_each(|f| bare(&mut f.attrs));
            counts(&s.vis, &s.ident)
        }
        Item::Enum(e) => {
            bare(&mut e.attrs);
            for variant in &mut e.variants {
                bare(&mut variant.attrs);
                variant.fields.iter_mut().for_each(|f| bare(&mut f.attrs));
            }
            counts(&e.vis, &e.ident)
        }
        Item::Trait(t) => {
            bare(&mut t.attrs);
            for item in &mut t.items {
                if let TraitItem::Fn(f) = item {
                    bare(&mut f.attrs);
                    f.default.iter_mut().for_each(|block| block.stmts.clear());
                }
            }
            counts(&t.vis, &t.ident)
        }
        Item::Const(c) => {
            bare(&mut c.attrs);
            counts(&c.vis, &c.ident)
        }
        Item::Static(s) => {
            bare(&mut s.attrs);
            counts(&s.vis, &s.ident)
        }
        Item::Type(t) => {
            bare(&mut t.attrs);
            counts(&t.vis, &t.ident)
        }
        Item::Use(u) => open && public(&u.vis),
        Item::Impl(i) => keep_public(i),
        _ => false,
    });
}

/// Keeps the attributes that belong to the interface.
fn bare(attrs: &mut Vec<Attribute>) {
    attrs.retain(|a| ["derive", "non_exhaustive", "cfg"].iter().any(|name| a.path().is_ident(name)));
}

/// Keeps the public items of an implementation; if it implements a trait, its types and macros. Returns whether to keep
/// the implementation.
fn keep_public(block: &mut ItemImpl) -> bool {
    bare(&mut block.attrs);
    let of_trait = block.trait_.is_some();
    block.items.retain_mut(|item| match item {
        ImplItem::Fn(f) => {
            bare(&mut f.attrs);
            f.block.stmts.clear();
            !of_trait && public(&f.vis)
        }
        ImplItem::Const(c) => {
            bare(&mut c.attrs);
            !of_trait && public(&c.vis)
        }
        ImplItem::Type(_) => true,
        ImplItem::Macro(_) => true,
        _ => false,
    });
    of_trait || !block.items.is_empty()
}

/// The names of all types that were kept.
fn types_of(items: &[Item], into: &mut BTreeSet<String>) {
    for item in items {
        match item {
            Item::Mod(ItemMod { content: Some((_, items)), .. }) => types_of(items, into),
            Item::Struct(s) => drop(into.insert(s.ident.to_string())),
            Item::Enum(e) => drop(into.insert(e.ident.to_string())),
            _ => {}
        }
    }
}

/// Keeps the implementations of `types`. Then removes empty modules.
fn keep_impls(items: &mut Vec<Item>, types: &BTreeSet<String>) {
    items.retain_mut(|item| match item {
        Item::Impl(i) => match &*i.self_ty {
            Type::Path(path) => {
                path.path.segments.last().is_some_and(|s| types.contains(&s.ident.to_string()))
            }
            _ => false,
        },
        Item::Mod(ItemMod { content: Some((_, items)), .. }) => {
            keep_impls(items, types);
            !items.is_empty()
        }
        _ => true,
    });
}

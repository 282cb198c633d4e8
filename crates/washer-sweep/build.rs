//! Makes Apple's linker leave Python's symbols to the process that loads the library, which other
//! linkers do by default. maturin passes the same option; this is for `cargo build`.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_VENDOR").is_ok_and(|vendor| vendor == "apple") {
        println!("cargo::rustc-cdylib-link-arg=-Wl,-undefined,dynamic_lookup");
    }
}

# Everything that must hold before a change lands.
ci:
    .ci/run

test:
    cargo test --release --workspace

fig12:
    cargo run --release -- run sweeps/fig12.toml

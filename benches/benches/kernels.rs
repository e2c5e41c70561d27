//! Wall-clock times of the kernels without Python around them.

use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use tega_benches::kernels;

fn bench(criterion: &mut Criterion) {
    for kernel in kernels() {
        let mut run = (kernel.make)();
        criterion.bench_function(&kernel.id, |bencher| bencher.iter(&mut run));
    }
}

criterion_group! {
    name = all;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(500));
    targets = bench
}
criterion_main!(all);

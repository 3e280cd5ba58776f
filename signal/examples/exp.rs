use std::hint::black_box;
use std::time::Instant;
fn best(name: &str, n: usize, mut f: impl FnMut()) {
    let mut b = f64::MAX;
    let mut v = vec![];
    for _ in 0..300 {
        let t = Instant::now();
        f();
        let e = t.elapsed().as_secs_f64() * 1e9 / n as f64;
        v.push(e);
        if e < b {
            b = e
        }
    }
    v.sort_by(f64::total_cmp);
    println!("{name:30} best {b:.3} median {:.3}", v[150]);
}
fn main() {
    zig();
    let mut x = 1.0f64;
    let c = black_box(1e-9f64);
    best("dependent add", 10000, || {
        for _ in 0..10000 {
            x = x + c;
        }
        black_box(x);
    });
    best("dependent mul", 10000, || {
        let c = black_box(0.99999f64);
        let mut x = 1.0;
        for _ in 0..10000 {
            x = x * c;
        }
        black_box(x);
    });
    best("dependent imul", 10000, || {
        let c = black_box(3u64);
        let mut x = 1u64;
        for _ in 0..10000 {
            x = x.wrapping_mul(c);
        }
        black_box(x);
    });
    let mut y = vec![0.0; 4096];
    let mut g = haptograph_signal::noise::Gaussian::new(1);
    best("gaussian", 4096, || g.fill(black_box(&mut y)));
    let mut g = haptograph_signal::noise::Uniform::new(1);
    best("uniform", 4096, || g.fill(black_box(&mut y)));
}
pub fn zig() {
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
    let mut g = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut y = vec![0.0; 4096];
    best("ziggurat", 4096, || {
        for y in black_box(&mut y).iter_mut() {
            *y = StandardNormal.sample(&mut g)
        }
    });
}

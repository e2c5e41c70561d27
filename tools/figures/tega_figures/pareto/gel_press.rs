//! Presses shapes into the gel and tells its displacement and what that took: `gel_grid.py` builds this with other grids.

use std::time::{Duration, Instant};

use tega_gel::{CELLS, Gel, HEIGHT, Indenter, Setup, Shape, WIDTH};

/// Pixels over which displacements are averaged, so that grids can be compared.
const BLOCK_PX: usize = 8;

fn presses() -> Vec<Indenter> {
    let shapes = [
        Shape::Sphere { radius: 4.4 },
        Shape::Sphere { radius: 12.0 },
        Shape::Cylinder { radius: 3.0, half_length: 6.0 },
        Shape::Cylinder { radius: 33.0, half_length: 100.0 },
        Shape::Box { half: [2.5, 2.5, 2.5] },
    ];
    let places = [(0.0, 0.0, 0.0_f64), (1.37, -2.11, 0.3)];
    let mut all = Vec::new();
    for shape in shapes {
        for force_n in [0.3, 1.0, 3.0] {
            for (x, y, tilt) in places {
                // A bar lies on its side, a block on its face; both are turned by as much about the pad's normal.
                let (c, s) = (tilt.cos(), tilt.sin());
                let pose_mm = match shape {
                    Shape::Cylinder { .. } => [[0.0, -s, c, x], [0.0, c, s, y], [-1.0, 0.0, 0.0, 0.0]],
                    _ => [[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, 0.0]],
                };
                all.push(Indenter { shape, pose_mm, force_n });
            }
        }
    }
    all
}

/// Displacement of each block, millimetres.
fn blocks(gel: &Gel) -> Vec<f32> {
    let mut cells = vec![0.0; CELLS[0] * CELLS[1]];
    gel.displacement(&mut cells);
    let (cell_px, [rows, cols]) = (HEIGHT / CELLS[0], [HEIGHT / BLOCK_PX, WIDTH / BLOCK_PX]);
    let mut means = vec![0.0; rows * cols];
    let share = (cell_px * cell_px) as f32 / (BLOCK_PX * BLOCK_PX) as f32;
    for (k, cell) in cells.iter().enumerate() {
        let (row, col) = (k / CELLS[1] * cell_px / BLOCK_PX, k % CELLS[1] * cell_px / BLOCK_PX);
        means[row * cols + col] += cell * share;
    }
    means
}

fn main() {
    let seconds = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(0.0);
    let setup = Setup { seed: 1, spread: 0.0, ..Setup::default() };
    let mut gel = Gel::new(setup).expect("a spread within bounds");
    let presses = presses();
    for press in &presses {
        gel.press(&[*press], 0.0).expect("a press");
        let map: Vec<String> = blocks(&gel).iter().map(f32::to_string).collect();
        println!("{} {}", gel.touch().depth_mm, map.join(" "));
    }
    // The least that each took, since others use the processor too.
    let mut least = vec![Duration::MAX; presses.len()];
    let until = Instant::now() + Duration::from_secs_f64(seconds);
    while Instant::now() < until {
        for (least, press) in least.iter_mut().zip(&presses) {
            let started = Instant::now();
            gel.press(&[*press], 0.0).expect("a press");
            *least = started.elapsed().min(*least);
        }
    }
    if seconds > 0.0 {
        let sum: Duration = least.iter().sum();
        println!("{}", 1e6 * sum.as_secs_f64() / presses.len() as f64);
    }
}

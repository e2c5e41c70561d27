//! Many frames in one call: the fingers of a hand, or a recording's frames over all cores.

use std::num::NonZero;
use std::thread;

/// Pixels from which starting threads pays: about a dozen frames of a fingertip camera.
const PARALLEL_FROM_PIXELS: usize = 1 << 20;

/// Applies `work` to every item, in order of the items: with `scratch` on this thread, or, where there are `pixels`
/// enough, on all cores with a scratch each.
pub fn each<T: Sync, S: Default, R: Send>(
    items: &[T],
    pixels: usize,
    scratch: &mut S,
    work: impl Fn(&T, &mut S) -> R + Sync,
) -> Vec<R> {
    let run =
        &|share: &[T], scratch: &mut S| share.iter().map(|item| work(item, scratch)).collect::<Vec<R>>();
    if pixels < PARALLEL_FROM_PIXELS || items.len() < 2 {
        return run(items, scratch);
    }
    // Asked only now: the answer may cost tens of microseconds.
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    if cores < 2 {
        return run(items, scratch);
    }
    let shares: Vec<&[T]> = items.chunks(items.len().div_ceil(cores)).collect();
    thread::scope(|scope| {
        let start = |share| thread::Builder::new().spawn_scoped(scope, move || run(share, &mut S::default()));
        let jobs: Vec<_> = shares.iter().map(|share| start(share)).collect();
        let done = jobs.into_iter().zip(&shares).flat_map(|(job, share)| {
            // A thread that could not start or finish leaves its share to this one, so that no item is lost.
            job.ok().and_then(|job| job.join().ok()).unwrap_or_else(|| run(share, scratch))
        });
        done.collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_come_in_the_order_of_the_items_however_many_threads_run() {
        let items: Vec<usize> = (0..97).collect();
        let square = |item: &usize, calls: &mut usize| {
            *calls += 1;
            item * item
        };
        let wanted: Vec<usize> = items.iter().map(|i| i * i).collect();
        assert_eq!(each(&items, 0, &mut 0, square), wanted);
        assert_eq!(each(&items, usize::MAX, &mut 0, square), wanted);
        assert_eq!(each(&[], usize::MAX, &mut 0, square), Vec::<usize>::new());
    }
}

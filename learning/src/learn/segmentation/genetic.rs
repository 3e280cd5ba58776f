//! The island genetic algorithm of Auto-PARM (Davis, Lee and Rodriguez-Yam 2006, as the thesis uses it), behind the same interface.
//!
//! A chromosome states for every sample whether a segment of some order starts there; it is stored as the list of these
//! starts. Children come from crossover (each start from either parent) or, rarely, mutation; the best of each
//! generation survives; at intervals the worst of each island are replaced by the best of its neighbour. It is kept for
//! comparison: [the exact search](super::SegmentationMethod::Exact) reaches a lower objective in a fraction of the
//! time.

use super::objective::Objective;
use super::variance::Estimator;
use super::{Segmentation, SegmentationSettings};
use haptograph_signal::parallel;
use rand::{Rng, RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::time::{Duration, Instant};

/// Settings of the genetic algorithm. The default has the thesis's 25 islands; values that the thesis does not state
/// are those of Auto-PARM.
#[derive(Debug, Clone, PartialEq)]
pub struct GeneticSettings {
    /// Populations that evolve apart, 1 to 1000.
    pub islands: usize,
    /// Chromosomes on an island, at least 4.
    pub population: usize,
    /// Generations between migrations.
    pub migration_interval: usize,
    /// Chromosomes that migrate: the best of an island replace as many of the worst of the next.
    pub migrants: usize,
    /// Stops after this many migrations without a better chromosome.
    pub patience: usize,
    /// Stops after this many generations.
    pub generations: usize,
    /// Stops at the first migration after this long. The result then depends on the machine's speed.
    pub time_limit: Option<Duration>,
    /// Seed of the random choices.
    pub seed: u64,
}

impl Default for GeneticSettings {
    fn default() -> Self {
        Self {
            islands: 25,
            population: 40,
            migration_interval: 5,
            migrants: 2,
            patience: 10,
            generations: 100,
            time_limit: None,
            seed: 1,
        }
    }
}

/// The chance that a mutated sample keeps its parent's gene, and that it gets none; else it gets a random order.
const KEEP: f64 = 0.3;
const CLEAR: f64 = 0.3;

/// A segment starts here and has this order.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Gene {
    start: usize,
    order: usize,
}

#[derive(Debug, Clone)]
struct Chromosome {
    genes: Vec<Gene>,
    cost: f64,
}

/// The best segmentation that the algorithm finds.
pub(super) fn best_found<E: Estimator>(
    objective: &mut Objective<'_, E>,
    settings: &SegmentationSettings,
    genetic: &GeneticSettings,
) -> Segmentation {
    let began = Instant::now();
    let mut islands: Vec<Island> = (0..genetic.islands).map(|i| Island::new(i, genetic)).collect();
    let threads = parallel::cores().min(islands.len());
    let mut best: Option<Chromosome> = None;
    let mut unchanged = 0;
    let mut generation = 0;
    while generation < genetic.generations && unchanged < genetic.patience {
        let interval = genetic.migration_interval.clamp(1, genetic.generations - generation);
        let moments = objective.moments;
        let share = islands.len().div_ceil(threads);
        parallel::map(threads, islands.chunks_mut(share), &|_| (), |group| {
            let mut objective = Objective::<E>::new(moments, settings);
            group.iter_mut().for_each(|island| island.evolve(&mut objective, genetic, interval));
        });
        generation += interval;
        unchanged += 1;
        for island in &islands {
            let candidate = &island.population[0];
            if best.as_ref().is_none_or(|best| candidate.cost < best.cost) {
                best = Some(candidate.clone());
                unchanged = 0;
            }
        }
        migrate(&mut islands, genetic.migrants);
        if genetic.time_limit.is_some_and(|limit| began.elapsed() >= limit) {
            break;
        }
    }
    let genes = best.map_or(vec![], |best| best.genes);
    objective.rate(genes.iter().skip(1).map(|gene| gene.start).collect())
}

/// Replaces the worst of every island by copies of the best of the island before.
fn migrate(islands: &mut [Island], migrants: usize) {
    let best: Vec<Vec<Chromosome>> =
        islands.iter().map(|island| island.population.iter().take(migrants).cloned().collect()).collect();
    let count = islands.len();
    for (i, island) in islands.iter_mut().enumerate() {
        let newcomers = &best[(i + count - 1) % count];
        let keep = island.population.len().saturating_sub(newcomers.len());
        island.population.truncate(keep);
        island.population.extend_from_slice(newcomers);
        island.sort();
    }
}

struct Island {
    /// The best first.
    population: Vec<Chromosome>,
    random: Xoshiro256PlusPlus,
}

impl Island {
    fn new(number: usize, genetic: &GeneticSettings) -> Self {
        let seed = genetic.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(number as u64);
        Self { population: vec![], random: Xoshiro256PlusPlus::seed_from_u64(seed) }
    }

    fn sort(&mut self) {
        self.population.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    }

    fn evolve<E: Estimator>(
        &mut self,
        objective: &mut Objective<'_, E>,
        genetic: &GeneticSettings,
        generations: usize,
    ) {
        if self.population.is_empty() {
            let first: Vec<_> =
                (0..genetic.population).map(|_| random_genes(objective, &mut self.random)).collect();
            self.population = first.into_iter().map(|genes| rated(objective, genes)).collect();
            self.sort();
        }
        let samples = objective.samples() as f64;
        let crossover_chance = 1.0 - objective.min_span as f64 / samples;
        for _ in 0..generations {
            let mut children = vec![self.population[0].clone()];
            while children.len() < genetic.population {
                let genes = if self.random.random_bool(crossover_chance) {
                    let (mother, father) = (self.parent(), self.parent());
                    self.cross(objective, mother, father)
                } else {
                    let parent = self.parent();
                    self.mutate(objective, parent)
                };
                children.push(rated(objective, genes));
            }
            self.population = children;
            self.sort();
        }
    }

    /// A parent, the likelier the better its rank (the lesser of two drawn ranks).
    fn parent(&mut self) -> usize {
        let count = self.population.len();
        self.random.random_range(0..count).min(self.random.random_range(0..count))
    }

    /// Crosses two parents: at every sample where one has a gene, it is taken with even chance.
    fn cross<E: Estimator>(
        &mut self,
        objective: &Objective<'_, E>,
        mother: usize,
        father: usize,
    ) -> Vec<Gene> {
        let (mother, father) = (&self.population[mother].genes, &self.population[father].genes);
        let mut merged: Vec<(Gene, bool)> =
            mother.iter().map(|&g| (g, true)).chain(father.iter().map(|&g| (g, false))).collect();
        merged.sort_by_key(|(gene, from_mother)| (gene.start, !from_mother));
        let mut child = Spacing::new(objective);
        let mut same_sample = None;
        for (gene, from_mother) in merged {
            let chosen = match same_sample {
                Some((start, chosen)) if start == gene.start => chosen,
                _ => self.random.random_bool(0.5),
            };
            same_sample = Some((gene.start, chosen));
            if chosen == from_mother || gene.start == 0 {
                child.push(gene);
            }
        }
        child.genes
    }

    fn mutate<E: Estimator>(&mut self, objective: &Objective<'_, E>, parent: usize) -> Vec<Gene> {
        let parent = &self.population[parent].genes;
        let mut inherited = parent.iter().peekable();
        let mut child = Spacing::new(objective);
        let mut start = 0;
        while start < objective.samples() {
            while inherited.next_if(|gene| gene.start < start).is_some() {}
            let chance: f64 = self.random.random();
            if chance < KEEP || start == 0 {
                if let Some(&gene) = inherited.next_if(|gene| gene.start == start) {
                    child.push(gene);
                }
            } else if chance >= KEEP + CLEAR {
                child.push(Gene { start, order: random_order(objective, &mut self.random) });
            }
            start = (start + 1).max(child.next_start);
        }
        child.genes
    }
}

/// Genes at least the minimum span apart from each other and from the end.
struct Spacing {
    genes: Vec<Gene>,
    next_start: usize,
    last_start: usize,
    min_span: usize,
}

impl Spacing {
    fn new<E: Estimator>(objective: &Objective<'_, E>) -> Self {
        let last_start = objective.samples().saturating_sub(objective.min_span);
        Self { genes: vec![], next_start: 0, last_start, min_span: objective.min_span }
    }

    /// Adds `gene` unless it is too close.
    fn push(&mut self, gene: Gene) {
        if gene.start >= self.next_start && gene.start <= self.last_start {
            self.genes.push(gene);
            self.next_start = gene.start + self.min_span;
        }
    }
}

fn random_order<E: Estimator>(objective: &Objective<'_, E>, random: &mut impl Rng) -> usize {
    random.random_range(1..=objective.moments.order)
}

/// A segment of random order at the first sample, and others that start with a chance of one in `samples / min span`.
fn random_genes<E: Estimator>(objective: &Objective<'_, E>, random: &mut impl Rng) -> Vec<Gene> {
    let chance = objective.min_span as f64 / objective.samples() as f64;
    let mut genes = Spacing::new(objective);
    genes.push(Gene { start: 0, order: random_order(objective, random) });
    for start in objective.min_span..objective.samples() {
        if start >= genes.next_start && random.random_bool(chance) {
            genes.push(Gene { start, order: random_order(objective, random) });
        }
    }
    genes.genes
}

/// A chromosome with its objective, every segment at the order its gene says (or the highest its span allows).
fn rated<E: Estimator>(objective: &mut Objective<'_, E>, genes: Vec<Gene>) -> Chromosome {
    let samples = objective.samples();
    let ends = genes.iter().skip(1).map(|gene| gene.start).chain(std::iter::once(samples));
    let segments: Vec<_> = genes.iter().zip(ends).map(|(gene, end)| (gene.start, end)).collect();
    let mut cost = Objective::<E>::break_penalty(genes.len() - 1);
    objective.variances(&segments, |objective, i, variances| {
        let span = segments[i].1 - segments[i].0;
        let order = genes[i].order.min(objective.highest_order(span));
        cost += objective.surprise(variances[order], span) + objective.penalty(order, span);
    });
    Chromosome { genes, cost }
}

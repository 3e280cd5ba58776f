//! A perceptron of one hidden layer: learned here, run by tract.

use rand::RngExt;
use tract_core::internal::*;
use tract_core::ops::einsum::EinSum;
use tract_core::ops::math;

/// Weights and biases: `[outputs][inputs + 1]`, the bias last.
struct Layer(Vec<Vec<f64>>);

impl Layer {
    fn new(inputs: usize, outputs: usize, random: &mut impl RngExt) -> Self {
        let most = 1.0 / (inputs as f64).sqrt();
        Self((0..outputs).map(|_| (0..=inputs).map(|_| random.random_range(-most..most)).collect()).collect())
    }

    fn run(&self, inputs: &[f64]) -> Vec<f64> {
        let sum =
            |row: &Vec<f64>| row.iter().zip(inputs).map(|(w, x)| w * x).sum::<f64>() + row[inputs.len()];
        self.0.iter().map(sum).collect()
    }

    /// One step down the gradient; returns that of the inputs.
    fn step(&mut self, inputs: &[f64], gradient: &[f64], rate: f64) -> Vec<f64> {
        let mut before = vec![0.0; inputs.len()];
        for (row, g) in self.0.iter_mut().zip(gradient) {
            for ((w, x), before) in row.iter_mut().zip(inputs).zip(&mut before) {
                *before += g * *w;
                *w -= rate * g * x;
            }
            row[inputs.len()] -= rate * g;
        }
        before
    }
}

/// `outputs = W2 tanh(W1 x + b1) + b2`.
pub struct Perceptron {
    hidden: Layer,
    last: Layer,
}

impl Perceptron {
    pub fn new(inputs: usize, units: usize, outputs: usize, random: &mut impl RngExt) -> Self {
        Self { hidden: Layer::new(inputs, units, random), last: Layer::new(units, outputs, random) }
    }

    /// Moves the mean output.
    pub fn begin_at(&mut self, outputs: &[f64]) {
        for (row, output) in self.last.0.iter_mut().zip(outputs) {
            row.iter_mut().for_each(|w| *w *= 0.1);
            *row.last_mut().expect("a bias") = *output;
        }
    }

    /// One step of gradient descent on the squared error.
    pub fn learn(&mut self, inputs: &[f64], wanted: &[f64], rate: f64) {
        let units: Vec<f64> = self.hidden.run(inputs).iter().map(|x| x.tanh()).collect();
        let error: Vec<f64> =
            self.last.run(&units).iter().zip(wanted).map(|(y, wanted)| y - wanted).collect();
        let back = self.last.step(&units, &error, rate);
        let back: Vec<f64> = back.iter().zip(&units).map(|(g, unit)| g * (1.0 - unit * unit)).collect();
        self.hidden.step(inputs, &back, rate);
    }

    /// The same network as tract runs it.
    pub fn runnable(&self) -> TractResult<ByTract> {
        let mut model = TypedModel::default();
        let inputs = self.hidden.0[0].len() - 1;
        let mut wire = model.add_source("inputs", f32::fact([1, inputs]))?;
        for (name, layer) in [("hidden", &self.hidden), ("last", &self.last)] {
            let (rows, columns) = (layer.0.len(), layer.0[0].len() - 1);
            let weights: Vec<f32> =
                layer.0.iter().flat_map(|row| row[..columns].iter().map(|w| *w as f32)).collect();
            let biases: Vec<f32> = layer.0.iter().map(|row| row[columns] as f32).collect();
            let weights = model
                .add_const(format!("{name}.weights"), Tensor::from_shape(&[rows, columns], &weights)?)?;
            let biases =
                model.add_const(format!("{name}.biases"), Tensor::from_shape(&[1, rows], &biases)?)?;
            let product = EinSum::new("mk,nk->mn".parse()?, f32::datum_type());
            wire = model.wire_node(format!("{name}.product"), product, &[wire, weights])?[0];
            wire = model.wire_node(format!("{name}.sum"), math::add(), &[wire, biases])?[0];
            if name == "hidden" {
                wire = model.wire_node("hidden.tanh", math::tanh(), &[wire])?[0];
            }
        }
        model.set_output_outlets(&[wire])?;
        Ok(ByTract(model.into_optimized()?.into_runnable()?))
    }
}

/// A network in tract's hands.
pub struct ByTract(TypedRunnableModel<TypedModel>);

impl ByTract {
    pub fn run(&mut self, inputs: &[f64]) -> Result<Vec<f64>, Box<dyn std::error::Error>> {
        let inputs: Vec<f32> = inputs.iter().map(|x| *x as f32).collect();
        let inputs = Tensor::from_shape(&[1, inputs.len()], &inputs)?;
        let outputs = self.0.run(tvec!(inputs.into()))?;
        Ok(outputs[0].as_slice::<f32>()?.iter().map(|y| f64::from(*y)).collect())
    }
}

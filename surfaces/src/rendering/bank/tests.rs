use super::*;
use crate::hull::Hull;
use crate::rendering::{RandomWalk, synthesise};
use crate::{ArmaModel, Grain, ModelAt, SpatialLine, VertexKind};

/// A texture of `order`, warped or plain, whose spectrum depends on speed and force.
fn texture(order: usize, warping: f64) -> TextureModel {
    let at = |(speed_m_s, force_n): (f64, f64)| {
        let lsf: Vec<f64> = (1..=order)
            .map(|k| {
                3.0 * (k as f64 + 0.3 * (k as f64 * 40.0 * speed_m_s + force_n).sin()) / (order as f64 + 1.0)
            })
            .collect();
        let power = 5.0 * speed_m_s * force_n;
        let model = match warping {
            0.0 => ArmaModel::from_lsf(&lsf, &[], 1.0, power),
            _ => ArmaModel::warped_from_lsf(&lsf, warping, power),
        };
        ModelAt { speed_m_s, force_n, model: model.unwrap(), kind: VertexKind::Measured }
    };
    let places = [(0.05, 0.5), (0.2, 0.5), (0.05, 2.0), (0.2, 2.0), (0.1, 1.0)];
    TextureModel::from_measured(10_000.0, places.map(at).to_vec(), &Hull::default()).unwrap()
}

/// One texture of each shape.
fn textures() -> Vec<TextureModel> {
    let with_lines = |texture: TextureModel| {
        let powers = texture.models().iter().map(|at| 0.1 * at.speed_m_s * at.force_n);
        let line = SpatialLine::new(800.0, 10.0, powers.collect()).unwrap();
        texture.with_lines(vec![line]).unwrap()
    };
    let grain = || Some(Grain::of_crackle(0.8, 0.004).unwrap());
    let mut recorded = vec![0.0; 15_000];
    haptograph_signal::noise::Gaussian::new(1).fill(&mut recorded);
    vec![
        texture(20, 0.85),
        with_lines(texture(20, 0.85)).with_clips(crate::layers::Clips::new(&recorded).ok()),
        texture(20, 0.85).with_grain(grain()).with_highpass_hz(Some(20.0)).unwrap(),
        with_lines(texture(7, 0.6)),
        texture(12, 0.0),
        with_lines(texture(12, 0.0)).with_grain(grain()).with_highpass_hz(Some(30.0)).unwrap(),
    ]
}

fn walk(seed: u64) -> Trajectory {
    RandomWalk {
        seconds: 0.1 + 0.01 * seed as f64,
        speed_m_s: (0.0, 0.2),
        force_n: (0.0, 2.5),
        cutoff_hz: 8.0,
        seed,
        ..RandomWalk::default()
    }
    .trajectory()
}

/// Voices of all textures in turn, each along its own walk.
fn voices<'a>(textures: &'a [TextureModel], walks: &'a [Trajectory]) -> Vec<Voice<'a>> {
    let voice = |(number, trajectory): (usize, &'a Trajectory)| Voice {
        texture: &textures[number % textures.len()],
        trajectory,
        settings: SynthesisSettings {
            seed: 3 * number as u64,
            lines_seed: 7,
            ..SynthesisSettings::default()
        },
    };
    walks.iter().enumerate().map(voice).collect()
}

fn bits(vibration: &[f64]) -> Vec<u64> {
    vibration.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn a_voice_has_the_same_bits_in_any_company() {
    let (textures, walks) = (textures(), (0..64).map(walk).collect::<Vec<_>>());
    let voices = voices(&textures, &walks);
    let together = synthesise_many(&voices, 2).unwrap();
    for (number, voice) in voices.iter().enumerate() {
        let alone = synthesise_many(&[*voice], 1).unwrap();
        assert_eq!(bits(&together[number]), bits(&alone[0]), "voice {number}");
        assert!(alone[0].iter().any(|y| y.abs() > 0.01));
    }
}

#[test]
fn a_voice_is_what_it_is_by_itself_but_for_rounding() {
    let (textures, walks) = (textures(), (0..20).map(walk).collect::<Vec<_>>());
    let voices = voices(&textures, &walks);
    for (voice, many) in voices.iter().zip(synthesise_many(&voices, 2).unwrap()) {
        let one = synthesise(voice.texture, voice.trajectory, &voice.settings).unwrap();
        let peak = one.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        assert_eq!(one.len(), many.len());
        let apart = one.iter().zip(&many).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
        assert!(apart < 1e-9 * peak, "{apart:e} of {peak}");
        if voice.texture.warping() == 0.0 {
            assert_eq!(bits(&one), bits(&many));
        }
    }
}

/// A voice into `out` at these points.
fn into<'a>(voice: &Voice<'a>, points: &'a UpdatePoints, out: &'a mut [f64]) -> VoiceInto<'a> {
    VoiceInto {
        texture: voice.texture,
        points,
        seed: voice.settings.seed,
        lines_seed: voice.settings.lines_seed,
        out,
    }
}

const ON: &(dyn Fn(f64) -> ControlFlow<()> + Sync) = &|_| ControlFlow::Continue(());

#[test]
fn speeds_and_forces_at_the_updates_are_enough() {
    let (textures, walks) = (textures(), (0..24).map(walk).collect::<Vec<_>>());
    let mut voices = voices(&textures, &walks);
    for (voice, update_hz) in voices.iter_mut().zip([240.0, 1000.0, 9.3, 1e9].into_iter().cycle()) {
        voice.settings.update_hz = update_hz;
    }
    let points: Vec<UpdatePoints> =
        voices.iter().map(|voice| voice.trajectory.at_updates(voice.settings.update_hz)).collect();
    // What was there before does not matter.
    let mut outs: Vec<Vec<f64>> = points.iter().map(|points| vec![f64::NAN; points.samples]).collect();
    let each = voices.iter().zip(&points).zip(&mut outs);
    let each = each.map(|((voice, points), out)| into(voice, points, out));
    synthesise_into(each.collect(), 2, ON).unwrap();
    for (out, many) in outs.iter().zip(synthesise_many(&voices, 1).unwrap()) {
        assert_eq!(bits(out), bits(&many));
    }
}

#[test]
fn points_and_outputs_that_do_not_fit_are_refused() {
    let (textures, walk) = (textures(), walk(1));
    let voice = voices(&textures, std::slice::from_ref(&walk))[0];
    let right = walk.at_updates(240.0);
    let refused = |points: &UpdatePoints, places: usize| {
        let mut out = vec![0.0; places];
        let error = synthesise_into(vec![into(&voice, points, &mut out)], 1, ON).unwrap_err();
        assert_eq!(error.voice, 0);
        error.source
    };
    let samples = right.samples;
    let output = refused(&right, samples - 1);
    let places = samples - 1;
    assert_eq!(output, SynthesisError::Output { samples, places });
    let mut short = right.clone();
    short.speed_m_s.pop();
    short.force_n.pop();
    let (updates, points) = (right.speed_m_s.len(), short.speed_m_s.len());
    assert_eq!(refused(&short, samples), SynthesisError::Updates { updates, points });
    short.force_n.pop();
    assert!(matches!(refused(&short, samples), SynthesisError::Lengths { .. }));
    let never = UpdatePoints { update_hz: f64::NAN, ..right.clone() };
    assert!(matches!(refused(&never, samples), SynthesisError::UpdateRate { .. }));
    let slow = UpdatePoints { rate_hz: 1000.0, ..right };
    assert!(matches!(refused(&slow, samples), SynthesisError::Rates { .. }));
}

#[test]
fn the_voice_that_is_refused_is_named() {
    let (textures, walks) = (textures(), (0..3).map(walk).collect::<Vec<_>>());
    let mut voices = voices(&textures, &walks);
    let stopped = synthesise_many_with(&voices, 2, &|_| std::ops::ControlFlow::Break(()));
    assert_eq!(stopped.unwrap_err().source, SynthesisError::Stopped);
    voices[2].settings.update_hz = 0.0;
    let refused = synthesise_many(&voices, 2).unwrap_err();
    assert_eq!(refused.voice, 2);
    assert!(matches!(refused.source, SynthesisError::UpdateRate { .. }));
    assert_eq!(synthesise_many(&[], 4), Ok(vec![]));
    let never = Trajectory { rate_hz: 10_000.0, speed_m_s: vec![], force_n: vec![] };
    let nothing = Voice { trajectory: &never, ..voices[0] };
    assert_eq!(synthesise_many(&[nothing, voices[0]], 1).unwrap()[0], Vec::<f64>::new());
}

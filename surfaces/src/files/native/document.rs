//! The structure of the file, field by field. Other types of the crate do not use serde.

use crate::files::{MAX_MODELS, MAX_TAP_SAMPLES, MAX_TAPS};
use crate::layers::{LAYERS, LayerKind, LayerSet};
use crate::{MAX_ORDER, Origin};
use haptograph_signal::units::decimal;
use ron::value::RawValue;
use serde::Deserialize;
use serde::de::value::{BorrowedStrDeserializer, MapAccessDeserializer};
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

#[derive(Deserialize)]
#[serde(rename = "Surface", deny_unknown_fields, bound(deserialize = "S: LayerSet"))]
pub(super) struct SurfaceDocument<'a, S> {
    pub format: u64,
    pub name: String,
    pub provenance: ProvenanceDocument,
    pub friction: Option<FrictionDocument>,
    pub stiffness: Option<StiffnessDocument>,
    pub taps: Option<TapsDocument>,
    #[serde(borrow)]
    pub texture: Option<LayeredTexture<'a, S>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProvenanceDocument {
    pub origin: OriginDocument,
    pub source: String,
    pub made_by: String,
    #[serde(default)]
    pub settings: Settings,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum OriginDocument {
    Simulated,
    Measured,
    Imported,
    Procedural,
}

impl From<OriginDocument> for Origin {
    fn from(origin: OriginDocument) -> Origin {
        match origin {
            OriginDocument::Simulated => Origin::Simulated,
            OriginDocument::Measured => Origin::Measured,
            OriginDocument::Imported => Origin::Imported,
            OriginDocument::Procedural => Origin::Procedural,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FrictionDocument {
    pub mu: f64,
    pub r_squared: Option<f64>,
    pub static_ratio: Option<f64>,
    pub stribeck_mm_s: Option<Thousandths>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StiffnessDocument {
    pub n_per_mm: f64,
    pub r_squared: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TapsDocument {
    pub rate_hz: f64,
    pub taps: Bounded<TapDocument, MAX_TAPS>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TapDocument {
    pub speed_mm_s: Thousandths,
    pub acceleration_m_s2: Bounded<f64, MAX_TAP_SAMPLES>,
    pub peak_force_n: Option<f64>,
}

/// The fields of a texture, those of the layers among them, as messages list them.
const TEXTURE_FIELDS: &[&str] = &{
    let (own, layers) =
        (["rate_hz", "warping", "highpass_hz", "recorded", "filters", "vertices", "triangles"], LAYERS.len());
    let mut fields = [""; 7 + LAYERS.len()];
    let (mut at, before) = (0, 4);
    while at < fields.len() {
        fields[at] = match at {
            _ if at < before => own[at],
            _ if at < before + layers => LAYERS[at - before].name,
            _ => own[at - layers],
        };
        at += 1;
    }
    fields
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TextureDocument {
    pub rate_hz: f64,
    pub warping: Option<f64>,
    pub highpass_hz: Option<f64>,
    pub recorded: Option<RecordedDocument>,
    pub filters: Bounded<FilterDocument, MAX_MODELS>,
    pub vertices: Bounded<VertexDocument, MAX_MODELS>,
    pub triangles: Option<Bounded<[u32; 3], { 2 * MAX_MODELS }>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RecordedDocument {
    pub speed_mm_s: (Thousandths, Thousandths),
    pub force_n: (f64, f64),
}

/// A texture with the values of its layers as they stand in the text.
pub(super) struct LayeredTexture<'a, S> {
    pub texture: TextureDocument,
    pub layers: Vec<(&'static LayerKind, &'a RawValue)>,
    set: PhantomData<S>,
}

impl<'de: 'a, 'a, S: LayerSet> Deserialize<'de> for LayeredTexture<'a, S> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_struct("TextureDocument", TEXTURE_FIELDS, TextureVisitor(PhantomData))
    }
}

struct TextureVisitor<'a, S>(PhantomData<(&'a (), S)>);

impl<'de: 'a, 'a, S: LayerSet> Visitor<'de> for TextureVisitor<'a, S> {
    type Value = LayeredTexture<'a, S>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("struct TextureDocument")
    }

    fn visit_map<A: MapAccess<'de>>(self, fields: A) -> Result<Self::Value, A::Error> {
        let mut fields = WithoutLayers { fields, kinds: S::KINDS, layers: Vec::new() };
        let texture = TextureDocument::deserialize(MapAccessDeserializer::new(&mut fields))?;
        Ok(LayeredTexture { texture, layers: fields.layers, set: PhantomData })
    }
}

/// The fields of a texture but for those of its layers, whose values it collects.
struct WithoutLayers<'de, A> {
    fields: A,
    kinds: &'static [LayerKind],
    layers: Vec<(&'static LayerKind, &'de RawValue)>,
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for &mut WithoutLayers<'de, A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, A::Error> {
        while let Some(name) = self.fields.next_key::<&'de str>()? {
            let Some(kind) = self.kinds.iter().find(|kind| kind.name == name) else {
                if !TEXTURE_FIELDS.contains(&name) {
                    return Err(A::Error::unknown_field(name, TEXTURE_FIELDS));
                }
                return seed.deserialize(BorrowedStrDeserializer::new(name)).map(Some);
            };
            if self.layers.iter().any(|(known, _)| known.name == name) {
                return Err(A::Error::duplicate_field(kind.name));
            }
            self.layers.push((kind, self.fields.next_value()?));
        }
        Ok(None)
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        self.fields.next_value_seed(seed)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FilterDocument {
    pub ar: Option<Coefficients>,
    pub ar_lsf: Option<Coefficients>,
    pub ma: Option<Coefficients>,
    pub ma_lsf: Option<Coefficients>,
    pub gain: Option<f64>,
}

pub(super) type Coefficients = Bounded<f64, MAX_ORDER>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VertexDocument {
    pub speed_mm_s: Thousandths,
    pub force_n: f64,
    pub filter: usize,
    pub variance: Option<f64>,
    pub power_m2_s4: Option<f64>,
    pub kind: KindDocument,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
pub(super) enum KindDocument {
    Measured,
    Fitted,
    Edge,
}

/// A list of limited length, so that a hostile file cannot exhaust memory.
pub(crate) struct Bounded<T, const MAX: usize>(pub Vec<T>);

impl<'de, T: Deserialize<'de>, const MAX: usize> Deserialize<'de> for Bounded<T, MAX> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct List<T, const MAX: usize>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>, const MAX: usize> Visitor<'de> for List<T, MAX> {
            type Value = Bounded<T, MAX>;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                write!(f, "a list of at most {MAX} entries")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut entries: A) -> Result<Self::Value, A::Error> {
                let mut list = Vec::new();
                while let Some(entry) = entries.next_element()? {
                    if list.len() == MAX {
                        return Err(A::Error::custom(format!("this list has more than {MAX} entries")));
                    }
                    list.push(entry);
                }
                list.shrink_to_fit();
                Ok(Bounded(list))
            }
        }
        deserializer.deserialize_seq(List(PhantomData))
    }
}

/// Names and values, each name once.
#[derive(Default)]
pub(super) struct Settings(pub BTreeMap<String, String>);

impl<'de> Deserialize<'de> for Settings {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Pairs;
        impl<'de> Visitor<'de> for Pairs {
            type Value = Settings;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a map of text to text, such as { \"seed\": \"7\" }")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut pairs: A) -> Result<Settings, A::Error> {
                let mut settings = BTreeMap::new();
                while let Some((name, value)) = pairs.next_entry::<String, String>()? {
                    if settings.contains_key(&name) {
                        return Err(A::Error::custom(format!("the setting \"{name}\" is given twice")));
                    }
                    settings.insert(name, value);
                }
                Ok(Settings(settings))
            }
        }
        deserializer.deserialize_map(Pairs)
    }
}

/// A number that the file has in 10^`PLACES` of the SI unit, converted exactly to SI.
pub(crate) struct Scaled<const PLACES: i32> {
    /// The number in SI.
    pub si: f64,
}

/// A number in mm/s or ms.
pub(crate) type Thousandths = Scaled<-3>;
/// A number per millimetre.
pub(crate) type PerMm = Scaled<3>;

impl<'de, const PLACES: i32> Deserialize<'de> for Scaled<PLACES> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let raw = <&'de RawValue>::deserialize(deserializer)?;
        // A number that is not a plain decimal (with a comment or grouped digits) can lose the last bit.
        let grouped = || {
            let scale = 10_f64.powi(PLACES.abs());
            let number = raw.into_rust::<f64>();
            let scaled = |x: f64| if PLACES < 0 { x / scale } else { x * scale };
            number.map(scaled).map_err(D::Error::custom)
        };
        let si = decimal::parse_shifted(raw.get_ron(), PLACES).map_or_else(grouped, Ok)?;
        Ok(Scaled { si })
    }
}

/// The locations of filters and vertices in the text, for error messages.
#[derive(Deserialize)]
#[serde(rename = "Surface")]
pub(super) struct Places<'a> {
    #[serde(borrow)]
    pub texture: Option<TexturePlaces<'a>>,
}

#[derive(Deserialize)]
pub(super) struct TexturePlaces<'a> {
    #[serde(borrow)]
    pub filters: Vec<&'a RawValue>,
    #[serde(borrow)]
    pub vertices: Vec<&'a RawValue>,
}

/// The version only, for files of another version.
#[derive(Deserialize)]
#[serde(rename = "Surface")]
pub(super) struct Head {
    pub format: u64,
}

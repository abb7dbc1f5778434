//! Words of other languages, without accents, for those of the vocabulary.

/// An English word with the words of German, French, Spanish, Italian, Portuguese, Dutch and Norwegian for it.
const WORDS: [(&str, &[&str]); 12] = [
    (
        "acceleration",
        &[
            "beschleunigung",
            "beschl",
            "aceleracion",
            "accelerazione",
            "aceleracao",
            "versnelling",
            "akselerasjon",
        ],
    ),
    (
        "angularvelocity",
        &[
            "drehrate",
            "winkelgeschwindigkeit",
            "vitesseangulaire",
            "vitessederotation",
            "velocidadangular",
            "velocitaangolare",
            "velocidadeangular",
            "hoeksnelheid",
            "vinkelhastighet",
        ],
    ),
    ("gyroscope", &["gyroskop", "giroscopio", "giroscopo", "gyroscoop"]),
    ("latitude", &["breite", "breitengrad", "latitud", "latitudine", "breedtegraad", "breddegrad"]),
    (
        "longitude",
        &["länge", "laenge", "längengrad", "longitud", "longitudine", "lengtegraad", "lengdegrad"],
    ),
    ("altitude", &["höhe", "hoehe", "altitud", "altura", "quota", "altitudine", "hoogte", "høyde"]),
    (
        "speed",
        &[
            "geschwindigkeit",
            "vitesse",
            "velocidad",
            "velocita",
            "velocidade",
            "snelheid",
            "hastighet",
        ],
    ),
    ("course", &["kurs", "cap", "rumbo", "rotta", "rumo", "koers", "routefond"]),
    ("time", &["zeit", "zeitstempel", "uhrzeit", "temps", "horodatage", "tiempo", "tempo", "tijd"]),
    ("date", &["datum", "fecha", "dato"]),
    (
        "depth",
        &[
            "tiefe",
            "profondeur",
            "immersion",
            "profundidad",
            "profondita",
            "profundidade",
            "diepte",
            "dybde",
        ],
    ),
    ("pressure", &["druck", "pression", "presion", "pressione", "pressao", "druk", "trykk"]),
];

/// The English word for a word.
pub fn english(word: &str) -> &str {
    WORDS.iter().find(|(_, words)| words.contains(&word)).map_or(word, |(english, _)| english)
}

/// A letter without its accent. Umlauts stay: they make other words.
pub fn plain(letter: char) -> char {
    match letter {
        'à' | 'á' | 'â' | 'ã' => 'a',
        'è' | 'é' | 'ê' | 'ë' => 'e',
        'ì' | 'í' | 'î' | 'ï' => 'i',
        'ò' | 'ó' | 'ô' | 'õ' => 'o',
        'ù' | 'ú' | 'û' => 'u',
        'ç' => 'c',
        'ñ' => 'n',
        other => other,
    }
}

//! Words of other languages, without accents, for those of the vocabulary.

/// An English word with the words of German, French, Spanish, Italian, Portuguese, Dutch, Norwegian and Chinese for it.
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
            "加速度",
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
            "角速度",
        ],
    ),
    ("gyroscope", &["gyroskop", "giroscopio", "giroscopo", "gyroscoop"]),
    (
        "latitude",
        &["breite", "breitengrad", "latitud", "latitudine", "breedtegraad", "breddegrad", "纬度"],
    ),
    (
        "longitude",
        &[
            "länge",
            "laenge",
            "längengrad",
            "longitud",
            "longitudine",
            "lengtegraad",
            "lengdegrad",
            "经度",
        ],
    ),
    (
        "altitude",
        &[
            "höhe",
            "hoehe",
            "altitud",
            "altura",
            "quota",
            "altitudine",
            "hoogte",
            "høyde",
            "高度",
            "海拔",
        ],
    ),
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
            "速度",
        ],
    ),
    ("course", &["kurs", "cap", "rumbo", "rotta", "rumo", "koers", "routefond", "航向"]),
    (
        "time",
        &[
            "zeit",
            "zeitstempel",
            "uhrzeit",
            "temps",
            "horodatage",
            "tiempo",
            "tempo",
            "tijd",
            "时间",
        ],
    ),
    ("date", &["datum", "fecha", "dato", "日期"]),
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
            "深度",
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

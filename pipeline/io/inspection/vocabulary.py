"""Words that bench software writes beside its columns, in six languages; for `inspect` only.

Stems are matched inside a word (German compounds: `Wicklungstemperatur`), so they have at least
four letters or are Chinese or Japanese; shorter ones are whole words. Accents are taken off first.
"""

from __future__ import annotations

QUANTITIES: dict[str, tuple[str, str]] = {
    # quantity: (unit of the glossary, words: English, German, French, Spanish, Chinese, Japanese)
    "time": ("s", "time timestamp zeit temps tiempo 时间 時間 时刻 時刻"),
    "voltage": ("V", "voltage volt volts spannung tension voltaje 电压 電圧"),
    "current": ("A", "current curr strom courant corriente intensite intensidad 电流 電流"),
    "torque": ("N·m", "torque trq drehmoment moment couple par 扭矩 转矩 トルク"),
    "speed": (
        "rad/s",
        "speed velocity vel rpm erpm drehzahl winkelgeschwindigkeit geschwindigkeit vitesse "
        "regime velocidad 转速 速度 回転数 回転速度",
    ),
    "angle": (
        "rad",
        "angle position pos theta encoder enc winkel drehwinkel lage stellung geber angulo "
        "posicion 位置 角度",
    ),
    "temperature": ("degC", "temp temperatur temperature temperatura 温度"),
    "resistance": ("ohm", "resistance widerstand resistencia 电阻 抵抗"),
    "inductance": ("H", "inductance induktivitaet induktivitat inductancia 电感 インダクタンス"),
    "flux": ("Wb", "flux fluss verkettung flujo lambda psi 磁链 磁束"),
    "frequency": ("Hz", "freq frequency frequenz frequence frecuencia 频率 周波数"),
    "power": ("W", "power leistung puissance potencia 功率 電力"),
    "duty": ("1", "duty dutycycle tastgrad aussteuerung 占空比 デューティ"),
}
QUALIFIERS: dict[str, str] = {
    "winding": (
        "winding wicklung wdg coil stator enroulement bobinage bobina devanado 绕组 巻線 電機子"
    ),
    "magnet": "magnet rotor aimant iman laeufer laufer 磁钢 磁石 转子 回転子",
    "case": "case housing frame gehaeuse gehause carcasse carter carcasa 外壳 机壳 筐体 ケース",
    "ambient": "ambient room umgebung raum ambiant ambiante ambiente 环境 室温 周囲",
    "motor": "motor moteur 电机 電動機 モータ",
    "bus": (
        "bus dc dclink zwischenkreis versorgung supply battery batterie batterie alimentation "
        "alimentacion input eingang vbus ubus 母线 直流 電源"
    ),
    "electrical": "el elec electrical elek elektrisch electrique electrico 电角 電気角",
    "d axis": "d daxis laengs langs d轴 d軸 id ud vd",
    "q axis": "q qaxis quer q轴 q軸 iq uq vq",
    "ab": "ab uv u12 v12 l1l2 rs",
    "bc": "bc vw u23 v23 l2l3 st",
    "ca": "ca wu u31 v31 l3l1 tr",
    "a": "a u l1 r u相 a相 1",
    "b": "b v l2 s v相 b相 2",
    "c": "c w l3 t w相 c相 3",
    "not measured": (
        "soll sollwert ref reference target cmd command commanded setpoint demand desired error "
        "err fehler abweichung limit grenze max min consigne ordre referencia 目标 指令 给定 設定"
    ),
}
SYMBOLS: dict[str, tuple[str, ...]] = {
    # letters of formulas that begin a name, and what they stand for where a unit settles it
    "t": ("time", "temperature", "torque"),
    "u": ("voltage",),
    "v": ("voltage", "speed"),
    "i": ("current",),
    "m": ("torque",),
    "n": ("speed",),
    "w": ("speed",),
    "omega": ("speed",),
    "phi": ("angle",),
    "r": ("resistance",),
    "l": ("inductance",),
    "f": ("frequency",),
}
TESTS: dict[str, str] = {
    # test of the contract: words in names of files
    "spin_down": (
        "spindown spin_down coast coastdown coasting auslauf ausrollen ralentissement "
        "deceleration desaceleracion 惰行 滑行 惰走"
    ),
    "open_circuit": (
        "opencircuit open_circuit backemf bemf emk leerlauf generator vide fem vacio 反电动势 "
        "空载 逆起電力 無負荷"
    ),
    "resistance": "resistance widerstand resistencia 电阻 抵抗",
    "current_step": "current_step step sprung stromsprung echelon escalon 阶跃 ステップ",
    "torque_map": "torque_map map kennfeld drehmomentkennfeld cartographie mapa 特性图 マップ",
    "heat_run": (
        "heat_run heatrun erwaermung erwarmung dauerlauf waermelauf echauffement calentamiento "
        "温升 温度上昇"
    ),
    "cogging": "cogging rastmoment nutrasten rast denture 齿槽 コギング",
    "hand_turn": "hand_turn hand handdrehung manuel manual 手动 手回し",
    "lcr": "lcr",
    "holding_current": "holding_current holding halten haltestrom maintien 保持",
    "flux_map": "flux_map fluxmap flusskennfeld 磁链图",
    "torque_table": "torque_table static statisch drehmomenttabelle 静态 静的 静特性 静トルク",
    "drive": "drive sixstep six_step fahrt betrieb zyklus log run conduite marche 运行 運転",
}
ROW_NUMBERS = "punkt messpunkt point nr no number nummer row zeile ligne fila 序号 番号"
"""Names of a column that counts the rows of a table, which is no clock."""
DIRECTIONS = "cw ccw fwd rev forward reverse vor zurueck rueck links rechts vorwaerts rueckwaerts"

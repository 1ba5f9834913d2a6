//! Mathematical constants; abstract, so that they take the precision of the expression they stand in.

const PI = 3.14159265358979323846;
const TWO_PI = 6.28318530717958647692;
const HALF_PI = 1.57079632679489661923;
const QUARTER_PI = 0.78539816339744830962;
const INVERSE_PI = 0.31830988618379067154;
const INVERSE_TWO_PI = 0.15915494309189533577;

//! Owen-scrambled Sobol points in four dimensions, without tables and without state (Burley 2020, "Practical Hash-based Owen
//! Scrambling", JCGT 9(4)). Numbers are fractions of 2^32.

/// Point `index` of a sequence of its own for every `shuffle_seed` and `seeds`. The points 2^m k to 2^m (k + 1) - 1 stay together.
fn scrambled_sobol4(index: u32, shuffle_seed: u32, seeds: vec4u) -> vec4u {
    let shuffled = owen_scramble(index, shuffle_seed);
    let point = sobol4(shuffled);
    return vec4u(
        owen_scramble(point.x, seeds.x),
        owen_scramble(point.y, seeds.y),
        owen_scramble(point.z, seeds.z),
        owen_scramble(point.w, seeds.w),
    );
}

/// Nested uniform scrambling in base 2: flips each bit or not, as `seed` and the bits above it say (Owen 1995). The hash is that of
/// Vegdahl 2021, "Building a Better LK Hash", in the manner of Laine and Karras 2011: no bit of it depends on a higher one.
fn owen_scramble(value: u32, seed: u32) -> u32 {
    var bits = reverseBits(value);
    bits ^= bits * 0x3d20adeau;
    bits += seed;
    bits *= (seed >> 16u) | 1u;
    bits ^= bits * 0x05526c56u;
    bits ^= bits * 0x53a22864u;
    return reverseBits(bits);
}

/// The first four dimensions of Sobol's sequence, with the primitive polynomials and initial direction numbers of Joe and Kuo 2008
/// (new-joe-kuo-6). x is the radical inverse; the direction numbers of y, z and w come from their recurrences
/// v_k = v_(k-1) ^ v_(k-1)/2,  v_k = v_(k-1) ^ v_(k-2) ^ v_(k-2)/4  and  v_k = v_(k-2) ^ v_(k-3) ^ v_(k-3)/8.
/// (x, y) is a (0,2)-sequence.
fn sobol4(index: u32) -> vec4u {
    var point = vec3u(0u);
    var direction = vec3u(0x80000000u);
    var next = vec3u(0xc0000000u);
    var second_next = vec3u(0xa0000000u, 0x60000000u, 0x20000000u);
    for (var bit = 0u; bit < 32u; bit++) {
        let taken = 0u - ((index >> bit) & 1u);
        point ^= direction & vec3u(taken);
        let third_next = vec3u(
            second_next.x ^ (second_next.x >> 1u),
            second_next.y ^ next.y ^ (next.y >> 2u),
            next.z ^ direction.z ^ (direction.z >> 3u),
        );
        direction = next;
        next = second_next;
        second_next = third_next;
    }
    return vec4u(reverseBits(index), point);
}

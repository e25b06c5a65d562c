"""A small JPEG Lossless encoder (SOF3), from ISO/IEC 10918-1 annex H."""
import heapq
import struct

import numpy as np


def residuals(a, selection, precision):
    p = np.empty_like(a)
    left, up, corner = np.roll(a, 1, 1), np.roll(a, 1, 0), np.roll(np.roll(a, 1, 0), 1, 1)
    p[:] = {
        1: left, 2: up, 3: corner, 4: left + up - corner, 5: left + ((up - corner) >> 1),
        6: up + ((left - corner) >> 1), 7: (left + up) >> 1,
    }[selection]
    p[:, 0] = up[:, 0]
    p[0] = left[0]
    p[0, 0] = 1 << (precision - 1)
    d = (a - p) & 0xFFFF
    return np.where(d > 32768, d - 65536, d).ravel()


def code_lengths(histogram):
    """Huffman lengths of at most 16 bits; the code of all ones stays unused."""
    heap = [(int(n), i, (i,)) for i, n in enumerate(histogram) if n] + [(0, 99, (-1,))]
    heapq.heapify(heap)
    lengths, ties = {}, 100
    while len(heap) > 1:
        a, b = heapq.heappop(heap), heapq.heappop(heap)
        for symbol in a[2] + b[2]:
            lengths[symbol] = lengths.get(symbol, 0) + 1
        heapq.heappush(heap, (a[0] + b[0], ties, a[2] + b[2]))
        ties += 1
    longest = max(lengths, key=lambda s: (lengths[s], s))
    lengths[-1], lengths[longest] = lengths[longest], lengths[-1]
    lengths.pop(-1)
    assert max(lengths.values()) <= 16
    return lengths


def encode(a, precision, selection=1):
    """The stream of unsigned samples `a`."""
    a = a.astype(np.int64)
    d = residuals(a, selection, precision)
    category = np.where(d == 0, 0, np.floor(np.log2(np.maximum(np.abs(d), 1))).astype(np.int64) + 1)
    lengths = code_lengths(np.bincount(category, minlength=17))
    order = sorted(lengths, key=lambda s: (lengths[s], s))
    codes, bits, code, before = np.zeros(17, np.int64), np.zeros(17, np.int64), 0, 0
    for symbol in order:
        code <<= lengths[symbol] - before
        before = lengths[symbol]
        codes[symbol], bits[symbol] = code, before
        code += 1
    extra = np.where(category == 16, 0, category)
    value = np.where(d > 0, d, d + (1 << category) - 1)
    words = (codes[category] << extra) | np.where(extra > 0, value, 0)
    count = bits[category] + extra
    ends = np.cumsum(count)
    within = np.arange(ends[-1]) - np.repeat(ends - count, count)
    stream = (np.repeat(words, count) >> (np.repeat(count, count) - 1 - within)) & 1
    stream = np.concatenate([stream, np.ones(-len(stream) % 8, np.int64)]).astype(np.uint8)
    data = np.packbits(stream).tobytes().replace(b'\xff', b'\xff\x00')
    table = b'\0' + bytes(sum(1 for s in order if lengths[s] == n) for n in range(1, 17)) + bytes(order)
    rows, columns = a.shape
    return (
        b'\xff\xd8\xff\xc4' + struct.pack('>H', 2 + len(table)) + table
        + b'\xff\xc3' + struct.pack('>HBHHB', 11, precision, rows, columns, 1) + b'\x01\x11\0'
        + b'\xff\xda\0\x08\x01\x01\0' + bytes([selection, 0, 0]) + data + b'\xff\xd9'
    )

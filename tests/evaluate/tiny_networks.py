"""Writes small ONNX networks with random weights, byte by byte (Protocol Buffers' wire format; the numbers are the fields
of onnx.proto3), and their weights for numpy."""

import os

import numpy


def varint(value):
    out = b""
    while value >= 128:
        out, value = out + bytes([value % 128 + 128]), value >> 7
    return out + bytes([value])


def number(field, value):
    return varint(field << 3) + varint(value)


def block(field, body):
    body = body.encode() if isinstance(body, str) else body
    return varint(field << 3 | 2) + varint(len(body)) + body


class Network:
    """Pictures [1, 3, any, any] go in."""

    def __init__(self, *inputs):
        self.graph, self.outputs = b"", b""
        for name in inputs:
            self.graph += block(11, self.value(name, 3))

    @staticmethod
    def value(name, channels):
        sides = [number(1, 1), number(1, channels)] + [block(2, f"{name}_{side}") for side in "hw"]
        return block(1, name) + block(2, block(1, number(1, 1) + block(2, b"".join(block(1, side) for side in sides))))

    def tensor(self, name, values, kind=1):
        values = numpy.asarray(values, "<f4" if kind == 1 else "<i8")
        self.graph += block(5, b"".join(number(1, side) for side in values.shape) + number(2, kind) + block(8, name) +
                            block(9, values.tobytes()))
        return name

    def node(self, kind, inputs, output, **integers):
        body = b"".join(block(1, name) for name in inputs) + block(2, output) + block(3, output) + block(4, kind)
        for name, value in integers.items():
            body += block(5, block(1, name) + (number(3, value) + number(20, 2) if isinstance(value, int) else
                                               b"".join(number(8, v) for v in value) + number(20, 7)))
        self.graph += block(1, body)
        return output

    def conv(self, x, weights, bias, output):
        return self.node("Conv", [x, self.tensor(output + "_w", numpy.asarray(weights)[:, :, None, None]),
                                  self.tensor(output + "_b", bias)], output, kernel_shape=[1, 1])

    def output(self, name, channels):
        self.outputs += block(12, self.value(name, channels))

    def write(self, path):
        with open(path, "wb") as file:
            file.write(number(1, 7) + block(8, block(1, "") + number(2, 11)) + block(7, self.graph + block(2, "tiny") + self.outputs))


def write_networks(folder, random):
    """lpips.onnx, edges.onnx and weights.npz."""
    w = {}
    for name, channels in (("lpips", 8), ("edges", 1)):
        w[name] = random.standard_normal((channels, 3)).astype("f4")
        w[name + "_bias"] = (0.3 * random.standard_normal(channels)).astype("f4")
    w["heads"] = random.random(8).astype("f4")
    numpy.savez(os.path.join(folder, "weights.npz"), **w)
    at = lambda name: os.path.join(folder, name + ".onnx")

    # As README.md of evaluate/ exports LPIPS: the sum over channels is a convolution with ones.
    lpips = Network("first", "second")
    for x in ("first", "second"):
        f = lpips.node("Relu", [lpips.conv(x, w["lpips"], w["lpips_bias"], x + "_c")], x + "_f")
        total = lpips.conv(lpips.node("Mul", [f, f], x + "_square"), numpy.ones((8, 8)), numpy.zeros(8), x + "_sum")
        length = lpips.node("Add", [lpips.node("Sqrt", [total], x + "_root"), lpips.tensor(x + "_eps", 1e-3)], x + "_length")
        lpips.node("Div", [f, length], x + "_unit")
    d = lpips.node("Sub", ["first_unit", "second_unit"], "difference")
    lpips.conv(lpips.node("Mul", [d, d], "squares"), [w["heads"]], [0], "weighted")
    lpips.node("GlobalAveragePool", ["weighted"], "distance")
    lpips.output("distance", 1)
    lpips.write(at("lpips"))

    edges = Network("picture")
    edges.node("Sigmoid", [edges.conv("picture", w["edges"], w["edges_bias"], "c")], "map")
    edges.output("map", 1)
    edges.write(at("edges"))

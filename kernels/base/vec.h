// Small fixed-size vectors and matrices, usable on host and device, for any scalar type.
#pragma once

#include <cmath>

#include "kernels/base/host_device.h"

namespace regrade {

template <typename T>
struct Vec3 {
  T x{}, y{}, z{};

  HD T& operator[](int i) { return (&x)[i]; }
  HD const T& operator[](int i) const { return (&x)[i]; }
  HD Vec3 operator+(const Vec3& o) const { return {x + o.x, y + o.y, z + o.z}; }
  HD Vec3 operator-(const Vec3& o) const { return {x - o.x, y - o.y, z - o.z}; }
  HD Vec3 operator-() const { return {-x, -y, -z}; }
  HD Vec3 operator*(T s) const { return {x * s, y * s, z * s}; }
  HD Vec3 operator/(T s) const { return {x / s, y / s, z / s}; }
  HD Vec3& operator+=(const Vec3& o) { return *this = *this + o; }
  HD bool operator==(const Vec3& o) const { return x == o.x && y == o.y && z == o.z; }

  template <typename U>
  HD Vec3<U> Cast() const {
    return {static_cast<U>(x), static_cast<U>(y), static_cast<U>(z)};
  }
};

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;
using Vec3i = Vec3<int>;

template <typename T>
HD Vec3<T> operator*(T s, const Vec3<T>& v) {
  return v * s;
}

template <typename T>
HD T Dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <typename T>
HD Vec3<T> Cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <typename T>
HD T Norm(const Vec3<T>& v) {
  using std::sqrt;
  return sqrt(Dot(v, v));
}

// v must not be 0.
template <typename T>
HD Vec3<T> Normalized(const Vec3<T>& v) {
  return v / Norm(v);
}

template <typename T>
HD bool AllFinite(const Vec3<T>& v) {
  using std::isfinite;
  return isfinite(v.x) && isfinite(v.y) && isfinite(v.z);
}

// A 3x3 matrix, stored by rows.
template <typename T>
struct Mat3 {
  Vec3<T> row[3] = {{T(1), T(0), T(0)}, {T(0), T(1), T(0)}, {T(0), T(0), T(1)}};

  HD T& operator()(int i, int j) { return row[i][j]; }
  HD const T& operator()(int i, int j) const { return row[i][j]; }
  HD Vec3<T> operator*(const Vec3<T>& v) const {
    return {Dot(row[0], v), Dot(row[1], v), Dot(row[2], v)};
  }
  HD Mat3 operator*(const Mat3& o) const {
    Mat3 result;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        result(i, j) = row[i].x * o(0, j) + row[i].y * o(1, j) + row[i].z * o(2, j);
    return result;
  }
  HD Mat3 Transposed() const {
    Mat3 result;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) result(i, j) = row[j][i];
    return result;
  }
  HD T Determinant() const { return Dot(row[0], Cross(row[1], row[2])); }

  template <typename U>
  HD Mat3<U> Cast() const {
    Mat3<U> result;
    for (int i = 0; i < 3; ++i) result.row[i] = row[i].template Cast<U>();
    return result;
  }
};

using Mat3f = Mat3<float>;
using Mat3d = Mat3<double>;

}  // namespace regrade

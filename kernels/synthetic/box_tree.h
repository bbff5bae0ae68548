// A tree of axis-aligned boxes: finds those that a ray or a point meets without testing them
// all.
#pragma once

#include <limits>
#include <vector>

#include "kernels/base/vec.h"
#include "kernels/scene/camera.h"

namespace regrade {

struct Box {
  Vec3d low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};  // empty at first
};

class BoxTree {
 public:
  // Enlarges each box a little, so that rounding hides none.
  explicit BoxTree(const std::vector<Box>& boxes);

  // Calls visit(i) for the boxes that the ray enters before `limit`, roughly by distance; visit
  // returns the new limit. A limit below 0 ends the search.
  template <typename Visit>
  void AlongRay(const RayT<double>& ray, double limit, const Visit& visit) const {
    const Line line(ray);
    int stack[kMaxDepth + 1], size = 0;
    for (int n = nodes_.empty() ? -1 : 0; n >= 0; n = size > 0 ? stack[--size] : -1) {
      while (line.Enters(nodes_[n], limit)) {
        const Node& node = nodes_[n];
        if (node.count > 0) {
          for (int k = node.first; k < node.first + node.count; ++k) {
            limit = visit(order_[k]);
            if (limit < 0) return;
          }
          break;
        }
        stack[size++] = line.backward[node.axis] ? n + 1 : node.first;
        n = line.backward[node.axis] ? node.first : n + 1;
      }
    }
  }

  // Indices of the boxes around a point, in ascending order.
  std::vector<int> Around(const Vec3d& point) const;

 private:
  static constexpr int kMaxDepth = 60;

  struct Node {
    Vec3d corner[2];  // low and high
    int first = 0;    // of a leaf's `count` entries of order_; otherwise the second child. The
                      // first child is the next node.
    int count = 0;    // 0: not a leaf
    int axis = 0;     // along which the children lie
  };

  struct Line {
    explicit Line(const RayT<double>& ray) : origin(ray.origin) {
      for (int a = 0; a < 3; ++a) {
        inverse[a] = 1 / ray.direction[a];
        backward[a] = inverse[a] < 0;
      }
    }

    // NaN, of a ray in the plane of a face, restricts nothing.
    bool Enters(const Node& node, double limit) const {
      double enter = 0, leave = limit;
      for (int a = 0; a < 3; ++a) {
        const double t0 = (node.corner[backward[a]][a] - origin[a]) * inverse[a];
        const double t1 = (node.corner[1 - backward[a]][a] - origin[a]) * inverse[a];
        enter = t0 > enter ? t0 : enter;
        leave = t1 < leave ? t1 : leave;
      }
      return enter <= leave;
    }

    Vec3d origin, inverse;
    int backward[3];
  };

  void Build(const std::vector<Box>& boxes, int first, int count, int depth);

  std::vector<Node> nodes_;
  std::vector<int> order_;  // of the boxes
};

}  // namespace regrade

// The minimum of a function of three numbers, without its gradient.
#pragma once

#include <algorithm>
#include <array>

namespace gmrf {

using Point3 = std::array<double, 3>;

// Nelder and Mead (1965), from a simplex with sides of about 1, within so many evaluations.
template <typename Function>
Point3 minimum(const Function& function, const Point3& start, int evaluations) {
  struct Vertex {
    Point3 x;
    double f;
  };
  const auto vertex = [&](const Point3& x) {
    --evaluations;
    return Vertex{x, function(x)};
  };
  std::array<Vertex, 4> simplex;
  simplex[0] = vertex(start);
  for (int k = 0; k < 3; ++k) {
    Point3 x = start;
    x[k] += 1.0;
    simplex[k + 1] = vertex(x);
  }
  const auto byValue = [](const Vertex& a, const Vertex& b) { return a.f < b.f; };
  while (evaluations > 0) {
    std::sort(simplex.begin(), simplex.end(), byValue);
    Point3 centre{};
    for (int v = 0; v < 3; ++v) {
      for (int k = 0; k < 3; ++k) centre[k] += simplex[v].x[k] / 3.0;
    }
    Vertex& worst = simplex[3];
    // On the line from the worst vertex through the others' centre: 0 the centre, -1 the worst.
    const auto along = [&](double t) {
      Point3 x;
      for (int k = 0; k < 3; ++k) x[k] = centre[k] + t * (centre[k] - worst.x[k]);
      return vertex(x);
    };
    const Vertex reflected = along(1.0);
    if (reflected.f < simplex[0].f) {
      const Vertex expanded = along(2.0);
      worst = expanded.f < reflected.f ? expanded : reflected;
    } else if (reflected.f < simplex[2].f) {
      worst = reflected;
    } else {
      const Vertex contracted = along(reflected.f < worst.f ? 0.5 : -0.5);
      if (contracted.f < std::min(reflected.f, worst.f)) {
        worst = contracted;
      } else {
        for (int v = 1; v < 4; ++v) {
          Point3 x;
          for (int k = 0; k < 3; ++k) x[k] = 0.5 * (simplex[0].x[k] + simplex[v].x[k]);
          simplex[v] = vertex(x);
        }
      }
    }
  }
  return std::min_element(simplex.begin(), simplex.end(), byValue)->x;
}

}  // namespace gmrf

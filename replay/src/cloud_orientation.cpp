#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "point_tree.hpp"
#include "scan_repair.hpp"
#include "vote_side.hpp"

namespace tubetrack {

namespace {

constexpr std::size_t kPlanePoints = 16;     // a normal's own point among them
constexpr std::size_t kGraphNeighbours = 8;  // whom a point may take its sign from
constexpr double kMostDisagreement = 0.02;   // of neighbouring normals of a file, that its signs be kept
constexpr float kDisagree = -0.5F;           // cosine: beyond a fold of 120° it is the sign that is wrong

/// An edge of the graph of near points.
struct Edge {
  float cost;  ///< 1 − |cosine| between the two normals: a sign is best passed on where the surface is flat
  std::uint32_t a, b;
  bool operator<(const Edge& other) const {
    if (cost != other.cost) return cost < other.cost;
    return a != other.a ? a < other.a : b < other.b;
  }
};

Eigen::Vector3f plane_normal(const std::vector<Eigen::Vector3d>& points, const std::vector<Neighbour>& near) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Neighbour& one : near) mean += points[one.index];
  mean /= static_cast<double>(near.size());
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const Neighbour& one : near) {
    const Eigen::Vector3d offset = points[one.index] - mean;
    moments += offset * offset.transpose();
  }
  const double scale = moments.trace();  // computeDirect wants numbers near 1
  if (!(scale > 0.0)) return Eigen::Vector3f::UnitZ();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(moments / scale);
  const Eigen::Vector3f normal = solver.eigenvectors().col(0).cast<float>().normalized();
  return normal.allFinite() ? normal : Eigen::Vector3f::UnitZ();
}

bool is_normal(const Eigen::Vector3f& normal) {
  return normal.allFinite() && normal.norm() > 1e-6F;
}

/// Of each point the nearest others, kGraphNeighbours places a point; kNone where there are fewer.
using Graph = std::vector<std::uint32_t>;

/// Fills in what is missing: all normals, or those that the file has as zero or NaN. Returns how many.
std::size_t estimate_missing(Scan& scan, const PointTree& tree, Graph& graph) {
  scan.normals.resize(scan.points_m.size(), Eigen::Vector3f::Zero());
  graph.assign(kGraphNeighbours * scan.points_m.size(), kNone);
  std::size_t estimated = 0;
  std::vector<Neighbour> near;
  for (const std::uint32_t i : tree.order()) {
    tree.nearest(scan.points_m[i], kPlanePoints, near);
    for (std::size_t k = 1; k < near.size() && k <= kGraphNeighbours; ++k)
      graph[kGraphNeighbours * i + k - 1] = near[k].index;
    if (is_normal(scan.normals[i])) {
      scan.normals[i].normalize();
      continue;
    }
    // A lone hole in the file's normals takes the sign of those around it.
    Eigen::Vector3f around = Eigen::Vector3f::Zero();
    for (const Neighbour& one : near) {
      if (is_normal(scan.normals[one.index])) around += scan.normals[one.index].normalized();
    }
    scan.normals[i] = plane_normal(scan.points_m, near);
    if (scan.normals[i].dot(around) < 0.0F) scan.normals[i] = -scan.normals[i];
    ++estimated;
  }
  return estimated;
}

std::vector<Edge> near_edges(const Scan& scan, const Graph& graph) {
  std::vector<Edge> edges;
  edges.reserve(graph.size() * 3 / 4);
  const auto others = [&](std::uint32_t point) {
    return std::span(graph).subspan(kGraphNeighbours * point, kGraphNeighbours);
  };
  for (std::uint32_t a = 0; a < scan.points_m.size(); ++a) {
    for (const std::uint32_t b : others(a)) {
      if (b == kNone) continue;
      const auto back = others(b);
      const bool mutual = std::find(back.begin(), back.end(), a) != back.end();
      if (mutual && b < a) continue;  // taken from the other end
      edges.push_back({1.0F - std::abs(scan.normals[a].dot(scan.normals[b])), std::min(a, b), std::max(a, b)});
    }
  }
  return edges;
}

double disagreement(const Scan& scan, const std::vector<Edge>& edges) {
  const auto disagrees = [&](const Edge& edge) { return scan.normals[edge.a].dot(scan.normals[edge.b]) < kDisagree; };
  const auto count = std::count_if(edges.begin(), edges.end(), disagrees);
  return edges.empty() ? 0.0 : static_cast<double>(count) / static_cast<double>(edges.size());
}

std::uint32_t root_of(std::vector<std::uint32_t>& parents, std::uint32_t point) {
  while (parents[point] != point) point = parents[point] = parents[parents[point]];
  return point;
}

/// The edges of a minimum spanning forest (Kruskal).
std::vector<Edge> spanning_forest(std::vector<Edge> edges, std::size_t point_count) {
  std::sort(edges.begin(), edges.end());
  std::vector<std::uint32_t> parents(point_count);
  std::iota(parents.begin(), parents.end(), 0U);
  std::vector<Edge> forest;
  for (const Edge& edge : edges) {
    const std::uint32_t a = root_of(parents, edge.a), b = root_of(parents, edge.b);
    if (a == b) continue;
    parents[std::max(a, b)] = std::min(a, b);
    forest.push_back(edge);
  }
  return forest;
}

/// Walks along the forest's edges, each tree from its first point, and turns normals that disagree with the one before.
/// Returns the trees' points.
std::vector<std::vector<std::uint32_t>> propagate(const std::vector<Edge>& forest,
                                                  std::vector<Eigen::Vector3f>& normals) {
  std::vector<std::uint32_t> begins(normals.size() + 1, 0), others(2 * forest.size());
  for (const Edge& edge : forest) {
    ++begins[edge.a + 1];
    ++begins[edge.b + 1];
  }
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  std::vector<std::uint32_t> free(begins.begin(), begins.end() - 1);
  for (const Edge& edge : forest) {
    others[free[edge.a]++] = edge.b;
    others[free[edge.b]++] = edge.a;
  }
  std::vector<std::vector<std::uint32_t>> trees;
  std::vector<bool> seen(normals.size(), false);
  for (std::uint32_t start = 0; start < normals.size(); ++start) {
    if (seen[start]) continue;
    std::vector<std::uint32_t> tree{start};
    seen[start] = true;
    for (std::size_t next = 0; next < tree.size(); ++next) {
      for (std::uint32_t k = begins[tree[next]]; k < begins[tree[next] + 1]; ++k) {
        const std::uint32_t other = others[k];
        if (seen[other]) continue;
        seen[other] = true;
        if (normals[other].dot(normals[tree[next]]) < 0.0F) normals[other] = -normals[other];
        tree.push_back(other);
      }
    }
    trees.push_back(std::move(tree));
  }
  return trees;
}

/// Turns each group outward as a whole. Returns how many points of how many could not be decided or were turned.
struct Turned {
  std::size_t over = 0;
  std::size_t undecided = 0;
};
Turned turn_outward(Scan& scan, const std::vector<std::vector<std::uint32_t>>& groups, double spacing_m) {
  Turned turned;
  for (const auto& group : groups) {
    std::vector<OrientedPoint> points;
    points.reserve(group.size());
    for (const std::uint32_t i : group) points.push_back({scan.points_m[i], scan.normals[i].cast<double>()});
    const VoteSide side = concentrated_side(points, spacing_m);
    if (side == VoteSide::undecided) turned.undecided += group.size();
    if (side != VoteSide::along_normals) continue;
    turned.over += group.size();
    for (const std::uint32_t i : group) scan.normals[i] = -scan.normals[i];
  }
  return turned;
}

}  // namespace

void clean_cloud(Scan& scan) {
  const std::size_t before = scan.points_m.size();
  const bool has_normals = !scan.normals.empty();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < before; ++i) {
    if (!scan.points_m[i].allFinite()) continue;
    if (has_normals) scan.normals[kept] = scan.normals[i];
    scan.points_m[kept++] = scan.points_m[i];
  }
  scan.points_m.resize(kept);
  if (kept != before)
    scan.notes.push_back(fmt::format("{} of {} points are not finite (no return): dropped", before - kept, before));
  const auto place = merge_equal_points(scan.points_m);
  // The first of equal points is the one that opens a new place; it is never behind its own.
  std::size_t opened = 0;
  for (std::size_t i = 0; has_normals && i < place.size(); ++i) {
    if (place[i] == opened) scan.normals[opened++] = scan.normals[i];
  }
  if (has_normals) scan.normals.resize(scan.points_m.size());
  if (scan.points_m.size() != kept) {
    scan.notes.push_back(
        fmt::format("{} of {} points repeat another one: merged", kept - scan.points_m.size(), before));
  }
}

void orient_cloud(Scan& scan, const std::optional<Eigen::Vector3d>& viewpoint_m, double spacing_m) {
  const PointTree tree(scan.points_m);
  const std::size_t all = scan.points_m.size();
  Graph graph;
  const std::size_t estimated = estimate_missing(scan, tree, graph);
  if (estimated != 0)
    scan.notes.push_back(
        fmt::format("normals of {} of {} points were estimated from their neighbours", estimated, all));
  if (viewpoint_m && estimated == all) {
    for (std::size_t i = 0; i < all; ++i) {
      if (scan.normals[i].dot((*viewpoint_m - scan.points_m[i]).cast<float>()) < 0.0F)
        scan.normals[i] = -scan.normals[i];
    }
    return;
  }
  std::vector<Edge> edges = near_edges(scan, graph);
  const double disagreeing = estimated == all ? 1.0 : disagreement(scan, edges);
  std::vector<std::vector<std::uint32_t>> groups;
  if (disagreeing > kMostDisagreement) {
    if (estimated != all)
      scan.notes.push_back(
          fmt::format("{:.1f} % of neighbouring normals point opposite ways: made to agree", 100.0 * disagreeing));
    groups = propagate(spanning_forest(std::move(edges), all), scan.normals);
  } else {
    groups.emplace_back(all);
    std::iota(groups.front().begin(), groups.front().end(), 0U);
  }
  const Turned turned = turn_outward(scan, groups, spacing_m);
  if (turned.over != 0 && estimated != all)
    scan.notes.push_back(fmt::format("normals of {} of {} points looked inward: turned", turned.over, all));
  if (turned.undecided != 0) {
    scan.notes.push_back(
        fmt::format("inside and outside could not be told for {} of {} points", turned.undecided, all));
  }
}

}  // namespace tubetrack

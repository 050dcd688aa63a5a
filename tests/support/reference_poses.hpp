#pragma once
// Reads the reference poses that other methods computed: robot.yaml and a table of poses, both as the tools write them.
// A test's reader: it knows the keys it needs and trusts the rest.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "ctcr/robot/robot.hpp"

namespace ctcr::test {

using Row = std::map<std::string, double>;

/// What a robot file says of its tubes and gravity, units as in its keys.
struct RobotFile {
  std::vector<Row> tubes;
  Vec3 gravity = Vec3::Zero();

  explicit RobotFile(const std::filesystem::path& path) {
    std::ifstream file(path);
    std::string line, section;
    int axis = 0;
    while (std::getline(file, line)) {
      const bool item = line.rfind("- ", 0) == 0;
      if (!item && line.rfind(' ', 0) != 0) section = line.substr(0, line.find(':'));
      const std::size_t colon = line.find(':');
      if (section == "gravity" && item) gravity[axis++] = std::stod(line.substr(2));
      if (section != "tubes" || section == line.substr(0, colon)) continue;
      if (item) tubes.emplace_back();
      tubes.back()[line.substr(2, colon - 2)] = std::stod(line.substr(colon + 1));
    }
  }

  template <int N>
  [[nodiscard]] Robot<N> robot() const {
    Robot<N> robot;
    robot.gravity = gravity;
    for (std::size_t i = 0; i < N; ++i) {
      const Row& t = tubes.at(i);
      robot.tubes[i] = {.youngs_modulus = t.at("youngs_modulus_GPa") * 1e9,
                        .poisson_ratio = t.at("poisson_ratio"),
                        .density = t.at("density_kg_m3"),
                        .inner_diameter = t.at("inner_diameter_mm") * 1e-3,
                        .outer_diameter = t.at("outer_diameter_mm") * 1e-3,
                        .length = t.at("length_mm") * 1e-3,
                        .curved_length = t.at("curved_length_mm") * 1e-3,
                        .curvature = t.at("curvature_per_m")};
    }
    return robot;
  }
};

/// Rows of a CSV file by the names of its columns.
inline std::vector<Row> read_table(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string line, cell;
  std::vector<std::string> names;
  std::vector<Row> rows;
  std::getline(file, line);
  for (std::istringstream header(line); std::getline(header, cell, ',');) names.push_back(cell);
  while (std::getline(file, line)) {
    Row& row = rows.emplace_back();
    std::istringstream cells(line);
    for (const std::string& name : names) {
      std::getline(cells, cell, ',');
      row[name] = std::stod(cell);
    }
  }
  return rows;
}

/// A folder below the project, which tests are run from.
inline std::filesystem::path reference_folder() { return "tests/data/reference"; }

/// Reference poses shared by several projects; may be absent. CTCR_SHARED_REFERENCE says where they are.
inline std::filesystem::path shared_reference_folder() {
  const char* folder = std::getenv("CTCR_SHARED_REFERENCE");
  return folder ? folder : "../shared/data/reference";
}

}  // namespace ctcr::test

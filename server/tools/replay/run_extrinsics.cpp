
#include <yaml-cpp/yaml.h>
#include <Eigen/Dense>

#include "base/text.hpp"
#include "base/yaml_text.hpp"
#include "tools/replay/run_files.hpp"

namespace fiducap {
namespace {

// How far T_BS may be from a rotation: files carry nine decimals.
constexpr double kRotationTolerance = 1e-5;

Expected<Pose> pose_from_matrix(const std::vector<double>& m, const std::string& name,
                                const std::string& context) {
  if (m.size() != 16)
    return fail(ErrorCode::kInvalid,
                name + ".T_BS.data must have 16 numbers, has " + std::to_string(m.size()), context);
  Eigen::Matrix3d R;
  R << m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10];
  const bool rigid = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <
                         kRotationTolerance &&
                     R.determinant() > 0;
  if (!rigid)
    return fail(ErrorCode::kInvalid, name + ".T_BS is no rotation with a translation", context);
  return Pose{Eigen::Quaterniond(R).normalized(), {m[3], m[7], m[11]}};
}

}  // namespace

std::string to_extrinsics_yaml(const std::vector<RunCamera>& cameras) {
  std::string text = "# Sensor to body, as estimated at the end of the run.\n";
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const Pose& X_BV = cameras[k].X_BV;
    const Eigen::Matrix3d R = X_BV.rotation();
    text += "cam" + std::to_string(k) + ":\n  T_BS:\n    cols: 4\n    rows: 4\n    data: [";
    for (int row = 0; row < 3; ++row)
      text += shortest(R(row, 0)) + ", " + shortest(R(row, 1)) + ", " + shortest(R(row, 2)) + ", " +
              shortest(X_BV.p(row)) + ", ";
    text += "0, 0, 0, 1]\n";
    const LensOffset& lens = cameras[k].lens;
    if (lens.is_none()) continue;
    text += "  # The lens beyond the recording's.\n  lens: {focal: " + shortest(lens.focal) +
            ", centre_px: [" + shortest(lens.centre_px.x()) + ", " + shortest(lens.centre_px.y()) +
            "], k1: " + shortest(lens.k1) + "}\n";
  }
  return text;
}

Expected<std::vector<RunCamera>> extrinsics_from_yaml(const std::string& text, std::size_t cameras,
                                                      const std::string& context) {
  std::vector<RunCamera> out;
  const auto root = load_yaml(text);
  if (!root) return fail(ErrorCode::kInvalid, root.error().text(), context);
  try {
    for (std::size_t k = 0; k < cameras; ++k) {
      const std::string name = "cam" + std::to_string(k);
      YAML::Node data = YAML::Clone(*root);
      for (const char* key : {name.c_str(), "T_BS", "data"})
        data.reset(data.IsMap() ? data[key] : YAML::Node());
      if (!data.IsDefined() || !data.IsSequence())
        return fail(ErrorCode::kInvalid, "needs " + name + ": T_BS: data: [16 numbers]", context);
      const auto pose = pose_from_matrix(data.as<std::vector<double>>(), name, context);
      if (!pose) return tl::unexpected(pose.error());
      out.push_back({*pose, {}});
      const YAML::Node camera = (*root)[name];
      const YAML::Node lens = camera["lens"];
      if (!lens.IsDefined()) continue;
      const auto centre = lens["centre_px"].as<std::vector<double>>();
      if (centre.size() != 2)
        return fail(ErrorCode::kInvalid, name + ".lens.centre_px must have 2 numbers", context);
      out.back().lens = {
          lens["focal"].as<double>(), {centre[0], centre[1]}, lens["k1"].as<double>()};
    }
  } catch (const YAML::Exception& problem) {
    return fail(ErrorCode::kInvalid, std::string("is no YAML: ") + problem.what(), context);
  }
  return out;
}

}  // namespace fiducap

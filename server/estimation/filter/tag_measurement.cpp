#include "estimation/filter/tag_measurement.hpp"

namespace fiducap {

void ImageMeasurement::take_off(const Eigen::VectorXd& error) {
  Vector6d of_shared = Vector6d::Zero();
  for (std::size_t k = 0; k < shared.term_count; ++k)
    of_shared += shared.terms[k].J * error.segment<3>(shared.terms[k].at);
  for (TagMeasurement& m : tags) {
    if (m.relative) {
      m.y += m.H * of_shared;
      if (m.own != TagMeasurement::kGiven) m.y -= m.H * error.segment<6>(m.own);
      if (!suspects.are_there()) continue;
      m.y -= m.H_camera * error.segment<SuspectColumns::kOfCamera>(suspects.camera);
      const double own_size = m.own_size < 0 ? 0.0 : error(m.own_size);
      m.y -= m.H_size * (error(suspects.size) + own_size);
    } else {
      for (std::size_t b = 0; b < m.block_count; ++b)
        m.y -= m.blocks[b].H * error.segment<3>(m.blocks[b].at);
    }
  }
}

}  // namespace fiducap

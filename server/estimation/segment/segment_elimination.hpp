#pragma once

#include <Eigen/Cholesky>
#include <array>
#include <span>
#include <vector>

#include "estimation/body_estimate.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "estimation/segment/segment_smoother.hpp"
#include "estimation/world/corner_measurement.hpp"

namespace fiducap {

/// Least squares problem of one segment, with the body's path between its ends eliminated instance
/// by instance. Linearised at the segment's present values; errors on the world's side about the
/// origin of its axes. Keeps a reference to the segment.
class SegmentElimination final {
 public:
  /// ½ zᵀ Λ z − ηᵀ z + cost, z = (the body now, the rest: [begin, end, cameras, tags, gravity]).
  struct Information {
    explicit Information(int rest)
        : own(Matrix15d::Zero()),
          beside(Eigen::MatrixXd::Zero(15, rest)),
          all(Eigen::MatrixXd::Zero(rest, rest)),
          own_pull(Vector15d::Zero()),
          pull(Eigen::VectorXd::Zero(rest)) {}

    Matrix15d own;
    Eigen::MatrixXd beside;
    Eigen::MatrixXd all;
    Vector15d own_pull;
    Eigen::VectorXd pull;
    double cost{0};
  };

  /// Back substitution of an eliminated instance.
  struct Eliminated {
    Eigen::LLT<Matrix15d> own;
    Matrix15d on_next;
    Eigen::MatrixXd on_rest;
    Vector15d pull;

    /// For an unchanged rest.
    [[nodiscard]] Vector15d error(const Vector15d& next) const {
      return own.solve(pull - on_next * next);
    }
  };

  explicit SegmentElimination(MotionSegment& segment);
  /// @return over the rest
  [[nodiscard]] Information run();
  /// The same with the rest fixed, for move_inner() alone.
  void run_path();
  /// After run() or run_path(): moves the inner instances to their solution.
  /// @return the largest step of a pose
  double move_inner();

  /// Of the inner instances, in their order.
  [[nodiscard]] const std::vector<Eliminated>& eliminated() const { return eliminated_; }
  [[nodiscard]] int sightings() const { return sightings_; }
  [[nodiscard]] int outliers() const { return outliers_; }

 private:
  /// Linear motion between two instances: ξ₊ = Φ ξ + G δ + r + w, with δ of gravity.
  struct Motion {
    Matrix15d Phi;
    Matrix15d W;  ///< Q⁻¹
    Vector15d r;
    Vector15d by_gravity;
  };
  /// Over (the body now, the rest) and the image's time.
  struct ImageSum {
    explicit ImageSum(int size)
        : H(Eigen::MatrixXd::Zero(size, size)),
          pull(Eigen::VectorXd::Zero(size)),
          by_time(Eigen::VectorXd::Zero(size)) {}
    Eigen::MatrixXd H;
    Eigen::VectorXd pull;
    Eigen::VectorXd by_time;
    double time{0};
    double time_pull{0};
    double cost{0};
  };
  struct Part {
    int at{};  ///< In (the body now, the rest).
    Matrix83d H;
  };
  struct Parts {
    std::array<Part, TagMeasurement::kMaxBlocks + 8> all;
    std::size_t count{0};
  };

  /// Size of the tag: its index, and the derivatives of the corners by it and by time.
  struct OfScale {
    int at{};
    Vector8d H;
    Vector8d on_time;
  };

  void prepare_workspace();
  void linearise_at(const MotionSegment::Instance& instance);
  [[nodiscard]] Motion move(const MotionSegment::Instance& from, const MotionSegment::Instance& to);
  void add_first_motion(const Motion& m, Information& info) const;
  static void start_body(const Motion& m, Information& info);
  [[nodiscard]] bool asks_for_gravity(const Information& info) const;
  void add_gravity(const Motion& m, Information& info) const;
  void add_motion(const Motion& m, Information& info);
  /// @param motion  the step before or after the instance; empty: not known
  void add_images(const MotionSegment::Instance& instance, std::span<const SegmentStep> motion,
                  Information& info);
  void add(const SegmentImage& image, const SegmentSighting& sighting, ImageSum& sum);
  static void add_products(const Parts& found, const Matrix8d& weight, const Vector8d& y,
                           const Vector8d& on_time, ImageSum& sum);
  static void add_scale(const Parts& found, const Matrix8d& weight, const Vector8d& y,
                        const OfScale& scale, ImageSum& sum);
  void place(const TagMeasurement::Block& block, Parts& parts) const;
  static void take_jitter(const SegmentImage& image, ImageSum& sum);

  MotionSegment& segment_;
  int cameras_;
  int rest_;
  CornerNoise noise_;             ///< Unused by measure(): every sighting has its own.
  world::FilterState workspace_;  ///< State at the present instance, for measure() and propagate().
  std::vector<Eliminated> eliminated_;
  int sightings_{0};
  int outliers_{0};
};

}  // namespace fiducap

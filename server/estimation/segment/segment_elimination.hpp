#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Cholesky>

#include "estimation/segment/motion_segment.hpp"
#include "estimation/segment/segment_smoother.hpp"
#include "estimation/segment/world_error.hpp"
#include "estimation/world/corner_measurement.hpp"

namespace fiducap {

using Matrix15d = Eigen::Matrix<double, 15, 15>;

/// The least squares problem of one segment, with the body's path between its ends taken out
/// instance by instance. Linearised where the segment is now; errors are about the origin of its
/// axes, on the world's side. Refers to the segment.
class SegmentElimination final {
 public:
  /// ½ zᵀ Λ z − ηᵀ z + cost over z = (the body now, the rest: [begin, end, cameras, tags,
  /// gravity]).
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

  /// How the body's place between two others is got back once those are known.
  struct Eliminated {
    Eigen::LLT<Matrix15d> own;
    Matrix15d on_next;
    Eigen::MatrixXd on_rest;
    Vector15d pull;

    /// When the rest is where the segment has it.
    [[nodiscard]] Vector15d error(const Vector15d& next) const {
      return own.solve(pull - on_next * next);
    }
  };

  explicit SegmentElimination(MotionSegment& segment);
  /// @return over the rest alone
  [[nodiscard]] Information run();
  /// The same with the rest held, for move_inner() alone: nothing is formed over the rest.
  void run_path();
  /// After run() or run_path(): the instances between go where they fit best.
  /// @return the largest step of a pose
  double move_inner();

  /// Of the instances between, in their order.
  [[nodiscard]] const std::vector<Eliminated>& eliminated() const { return eliminated_; }
  [[nodiscard]] int sightings() const { return sightings_; }
  [[nodiscard]] int numbers() const { return numbers_; }
  [[nodiscard]] int outliers() const { return outliers_; }

 private:
  /// Between two instances, linear: ξ₊ = Φ ξ + G δ + r + w, δ: of gravity.
  struct Motion {
    Matrix15d Phi;
    Matrix15d W;  ///< Q⁻¹
    Vector15d r;
    Vector15d by_gravity;
  };
  /// Over (the body now, the rest), and the moment at which the image was taken beside it.
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

  /// The print of the tag: where it stands, how corners hang on it, and on the moment.
  struct OfScale {
    int at{};
    Vector8d H;
    Vector8d on_time;
  };

  void prepare_bench();
  void begin_run();
  void stand_at(const MotionSegment::Instance& instance);
  void remember_rate(const SegmentStep* step);
  [[nodiscard]] Motion move(const MotionSegment::Instance& from, const MotionSegment::Instance& to);
  void leave_begin(const Motion& m, Information& info) const;
  static void start_body(const Motion& m, Information& info);
  [[nodiscard]] bool asks_for_gravity(const Information& info) const;
  void add_gravity(const Motion& m, Information& info) const;
  void leave(const Motion& m, Information& info);
  void arrive(Information& info) const;
  void look(const MotionSegment::Instance& instance, Information& info);
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
  CornerNoise noise_;  ///< Not looked at: every sighting has its own.
  world::FilterState bench_;
  std::vector<Eliminated> eliminated_;
  int sightings_{0};
  int numbers_{0};
  int outliers_{0};
};

}  // namespace fiducap

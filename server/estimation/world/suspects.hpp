#pragma once

#include <array>
#include <span>
#include <vector>

#include "estimation/found_mismatch.hpp"
#include "estimation/known_map.hpp"
#include "estimation/lens_estimate.hpp"
#include "estimation/start/start_lessons.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// What the configuration says of lens, shutter and prints is doubted, and corrected once it is
/// surely wrong.
///
/// Each of these numbers stands in the state with a prior so tight that it teaches the rest nothing
/// while the configuration is right. The posterior shows what the data would say without the prior:
/// information λ = 1/P − 1/σ², z = b̂ / (P √λ) (a score test; B. Friedland, IEEE
/// Trans. Autom. Control 14, 1969, treats such a bias apart from the state). When the most
/// suspicious one stays beyond `kOpen_sigma` it is opened (a lens as a whole): the tight prior is
/// exchanged for the honest one, as if it had been there from the beginning (a measurement of zero
/// with negative information takes the difference back). One that turns out to be as configured is
/// closed again. The prints of single tags are watched a few at a time, from the moment they join.
///
/// A lens whose sigma is told, or that shall be refined, is no suspect but a parameter: open from
/// the beginning with its own prior, and never closed. Where nothing can be doubted, lenses and
/// prints are assumed to be as good as such things are: whoever updates the state holds them at
/// their tight priors, so that the poses are those of the configuration, and the poses are given
/// out as unsure as what was assumed makes them (consider covariance).
class Suspects final {
 public:
  struct Rules {
    bool doubts{true};    ///< False: only what shall be refined stands in the state.
    bool refines{false};  ///< Every lens, not only those whose sigmas are told.
    bool assumes{false};  ///< Instead of doubting.
  };

  /// @param cameras  their readout is only doubted where the configuration calls it exact
  Suspects(const std::vector<CameraMount>& cameras, const Rules& rules)
      : cameras_(cameras), rules_(rules) {}

  /// Into a state that has just been reset.
  void begin(FilterState& state);
  /// After begin(): what another filter found to be wrong in the same start is open from the first.
  void begin_open(FilterState& state, std::span<const WrongNumber> wrong) const;
  /// What is open now of lenses and readouts, but for what always is.
  [[nodiscard]] std::vector<WrongNumber> found_wrong(const FilterState& state) const;
  /// A tag has joined. Its print is watched, if need be instead of one that is out of sight.
  void watch_print(FilterState& state, int tag_id) const;
  /// After an image of `camera` has corrected the state.
  /// @param dispersion  innovations squared over what was expected; 1: as they should be
  /// @return whether one was opened: what it did to images has been taken for noise until now
  bool look(FilterState& state, int camera, double dispersion) const;
  /// What the data have said so far of each number, closed ones too.
  struct Evidence {
    double score{};        ///< In sigmas of the data.
    double information{};  ///< Beside the prior's.
    double variance{};
  };
  [[nodiscard]] std::vector<Evidence> evidence(const FilterState& state) const;
  /// After the map was taken over: it was made with the same numbers taken for right, so it is no
  /// witness. What is closed is neither known better than before nor accused more.
  void keep_evidence(FilterState& state, std::span<const Evidence> before) const;
  /// What the map was made with open (KnownMap::wrong_prints, …) is open in the state, too. A map
  /// that was judged acquits the rest, and nothing is opened without it for ten seconds: its maker
  /// has seen the same images, and against tags that are where they are.
  /// @return whether one was opened: what it did to images has been taken for noise until now
  bool follow_map(FilterState& state, const KnownMap& map, int body_id) const;
  /// What is closed, and accused so far, begins anew: images said of it what was something else.
  void acquit(FilterState& state, double from_sigma = 0) const;
  /// What was opened and is settled well enough to be told.
  void list(const FilterState& state, std::vector<FoundMismatch>& out) const;
  /// What the body's covariance (world-side error) lacks: that of what is assumed, and how far it
  /// would move if what is suspected, and not yet opened, were as wrong as the data say.
  [[nodiscard]] Matrix6d unstated(const FilterState& state) const;
  /// Whether images may correct a camera's lens.
  [[nodiscard]] bool is_refined(int camera) const;
  /// Whether it is a guess, or was found to be wrong: more open than a calibration leaves it.
  [[nodiscard]] bool is_lens_open(const FilterState& state, int camera) const;
  /// Whether it stays within what its calibration leaves open. false: it is none.
  [[nodiscard]] bool is_as_calibrated(const FilterState& state, int camera) const;
  /// Whether the data know a camera's lens and readout, and the size of all prints, well enough to
  /// say that they are as configured.
  [[nodiscard]] bool are_cleared(const FilterState& state, int camera) const;
  /// A camera's lens as far as it is open.
  [[nodiscard]] LensEstimate lens(const FilterState& state, int camera) const;

 private:
  struct Suspect {
    FoundMismatch::Kind kind{};
    int camera{-1};
    int print{-1};  ///< Of kOnePrint: which watched one.
    int column{};
    double tight_sigma{};      ///< Closed …
    double open_sigma{};       ///< … and open.
    double settled{};          ///< Known so well it may be closed again.
    bool is_parameter{false};  ///< Open for good.
    double assumed_sigma{};    ///< How far it may be off without being doubted; 0: not assumed.
  };

  [[nodiscard]] static double score(const FilterState& state, const Suspect& suspect);
  /// How far opening it would move the body (world-side error).
  [[nodiscard]] static Vector6d pull(const FilterState& state, const Suspect& suspect);
  [[nodiscard]] static double value(const FilterState& state, const Suspect& suspect);
  static void assume(Suspect& suspect, double sigma);
  [[nodiscard]] static bool opens_with(const Suspect& suspect, const Suspect& other);
  [[nodiscard]] int room_for_print(const FilterState& state) const;
  [[nodiscard]] std::vector<int> closed_columns(const FilterState& state) const;
  void add_lens(int camera);
  void add_sizes(int cameras);
  void list_lens(const FilterState& state, int camera, std::vector<FoundMismatch>& out) const;
  void open(FilterState& state, int camera, std::size_t suspect) const;
  bool open_by_map(FilterState& state, const KnownMap& map, int body_id) const;
  bool open_anew(FilterState& state, std::size_t suspect) const;
  [[nodiscard]] bool is_closed(const FilterState& state, std::size_t suspect) const;
  void close(FilterState& state, int camera, std::size_t suspect) const;
  void release_cleared_prints(FilterState& state) const;

  /// Worth considering: what nine of ten numbers that are right never reach.
  static constexpr double kSuspected_sigma = 2.0;

  const std::vector<CameraMount>& cameras_;
  Rules rules_;
  std::vector<Suspect> all_;
};

}  // namespace fiducap::world

#pragma once

#include <string>

#include "tools/terminal.hpp"

namespace fiducap {

struct CalibrateCameraArguments {
  std::string input;      ///< Folder of pictures, video file or recording; empty with `corners`.
  std::string corners{};  ///< CSV of corners that another program found, see corner_file.hpp; …
  std::string board{};    ///< … what they are of, see board_description.hpp; empty: tags …
  std::string size{};     ///< … and the size of the images, WIDTHxHEIGHT.
  std::string set{};      ///< Of a file of corners that holds several.
  std::string checkerboard;  ///< COLUMNSxROWS of inner corners; empty: tags.
  double square_mm{30};
  double tag_mm{0};      ///< 0: what a recording says, else 160.
  std::string family{};  ///< Empty: what a recording says, else tag36h11.
  std::string lens{"auto"};
  bool loose{false};
  int camera{0};
  int views{120};
  std::string out{"calibration"};
  bool force{false};  ///< Write camera.yaml although the verdict refuses it.
  bool json{false};
};

/// `fiducap calibrate camera`: writes camera.yaml and camera.svg. @return exit code
[[nodiscard]] int run_calibrate_camera(const CalibrateCameraArguments& arguments,
                                       const Terminal& terminal);

}  // namespace fiducap

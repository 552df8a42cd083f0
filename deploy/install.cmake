# The server as a package or `cmake --install build/release --component server` puts it on a machine. The client has
# rules of its own (client/cmake/install.cmake); `cmake --install` alone does both.
include(GNUInstallDirs)

install(TARGETS fiducapd fiducap RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT server)
if(FIDUCAP_WEB)
  # The server finds the page at ../share from where it stands.
  install(DIRECTORY ${CMAKE_BINARY_DIR}/bin/web/ DESTINATION share/fiducap/web COMPONENT server)
endif()
install(FILES README.md ARCHITECTURE.md CHANGELOG.md LICENSE
  DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT server)
install(DIRECTORY docs config DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT server)
# Where systemd and udev look below any usual prefix, whatever the libraries' folder is called.
install(FILES deploy/99-fiducap-cameras.rules DESTINATION lib/udev/rules.d COMPONENT server)
install(CODE "set(source \"${PROJECT_SOURCE_DIR}/deploy\")" COMPONENT server)
install(SCRIPT deploy/install_service.cmake COMPONENT server)

"use strict";
for (const row of document.querySelectorAll(".row")) {
  const viewers = [...row.querySelectorAll("model-viewer")];
  for (const viewer of viewers) {
    viewer.addEventListener("camera-change", (event) => {
      if (event.detail.source !== "user-interaction") return;
      for (const other of viewers) {
        if (other === viewer || !other.loaded) continue;
        other.cameraOrbit = viewer.getCameraOrbit().toString();
        other.cameraTarget = viewer.getCameraTarget().toString();
        other.fieldOfView = `${viewer.getFieldOfView()}deg`;
        other.jumpCameraToGoal();
      }
    });
  }
}

// The benchmark room (scenes/room.toml) for POV-Ray 3.7: same shapes, lights, camera, materials and cut-off.
//
//   povray +Ibenchmarks/room.pov +W1024 +H1024 -A +WT2 -D File_Gamma=1.0 +Oroom.png
//
// POV-Ray is left-handed: every z of the scene file is negated here. File_Gamma=1.0 stores the values as they are,
// as the document does. What differs from the document's model, and by how little:
// * `metallic` is POV-Ray's way to give highlights the color of the surface; it whitens them at grazing angles.
// * POV-Ray's glass casts filtered shadows; here an unseen ball inside it casts the document's opaque shadow.
// * adc_bailout compares the color factors along the path too; the document's cut-off leaves color and ambient
//   out, so the dark tiles lose a faint reflection here (up to 6/255).
#version 3.7;

#declare Ambient = 0.2;
#declare Direct = 1 - Ambient;

global_settings { assumed_gamma 1.0 max_trace_level 64 adc_bailout 0.05 ambient_light rgb 1 }
background { rgb 0 }

// ---- Camera: canvas of 1024 x 1024 units, 1150 in front of the eye, turned 14 degrees down ----
#declare Canvas_center = <0, 620, 0>;
#declare Forward = vrotate(z, x*14);
camera {
  perspective
  location Canvas_center - 1150*Forward
  direction 1150*Forward
  right 1024*x
  up 1024*vrotate(y, x*14)
}

// ---- Lights: no fall-off, weights 3 : 2 : 1 ----
light_source { <-650, 1500, -500> rgb 3/6 }
light_source { < 700, 1200, -100> rgb 2/6 }
light_source { < 100, 1000, -900> rgb 1/6 }

// ---- I = C * (a + (1 - a) * (k_a * (m * D + h * H) + k_r * reflected)) ----
#macro Surface(Color, Reflection, Diffuse, Specular, Shininess)
  texture {
    pigment { rgb Color }
    finish {
      ambient Ambient
      diffuse Direct*(1 - Reflection)*Diffuse
      phong Direct*(1 - Reflection)*Specular
      phong_size Shininess
      metallic
      reflection { rgb Direct*Reflection*Color }
    }
  }
#end

// ---- Planes ----
plane {
  y, 0
  texture {
    checker
    Surface(<242/255, 239/255, 230/255>, 0.12, 1, 0.1, 20)
    Surface(<74/255, 85/255, 96/255>, 0.12, 1, 0.1, 20)
    translate <1, -0.5, 0>  // 1: z mirrored swaps the colors; -0.5: the floor inside a cell, not on its border
    scale 150
  }
}

plane {
  z, 1500
  texture {
    pigment {
      gradient x  // turned to x + y; the wall is at x + y + z(document) = x + y - 1500
      color_map {
        [0/3 rgb <233/255, 223/255, 201/255>] [1/3 rgb <233/255, 223/255, 201/255>]
        [1/3 rgb <201/255, 211/255, 192/255>] [2/3 rgb <201/255, 211/255, 192/255>]
        [2/3 rgb <220/255, 198/255, 176/255>] [3/3 rgb <220/255, 198/255, 176/255>]
      }
      scale 3*130/sqrt(2)
      rotate z*45
      translate x*(1500 - 3*130*1000)
    }
    finish { ambient Ambient diffuse Direct }
  }
}

plane { x, -900 Surface(<216/255, 164/255, 143/255>, 0, 1, 0, 1) }
plane { x, 900 Surface(<143/255, 179/255, 201/255>, 0, 1, 0, 1) }

// ---- Balls ----
sphere { <-260, 380, 950>, 380 Surface(<251/255, 251/255, 255/255>, 0.8, 0.5, 1, 80) }
sphere { <-500, 160, 420>, 160 Surface(<217/255, 54/255, 43/255>, 0.15, 0.9, 0.6, 50) }
sphere { <-110, 125, 260>, 125 Surface(<47/255, 111/255, 208/255>, 0, 0.9, 0.3, 12) }
sphere { <560, 270, 1050>, 270 Surface(<232/255, 178/255, 58/255>, 0.35, 0.8, 0.8, 25) }

// Glass: k_r = 0.2, k_t = 0.7, so k_a = 0.1. POV-Ray scales ambient and diffuse by 1 - filter * max(color).
#declare Glass = <242/255, 255/255, 246/255>;
#declare Filter = Direct*0.7;
sphere {
  <250, 220, 330>, 220
  texture {
    pigment { rgb Glass filter Filter }
    finish {
      ambient Ambient/(1 - Filter)
      diffuse Direct*0.1*0.4/(1 - Filter)
      phong Direct*0.1*1.0
      phong_size 100
      metallic
      reflection { rgb Direct*0.2*Glass }
    }
  }
  interior { ior 1.5 }
}
sphere { <250, 220, 330>, 219.9 pigment { rgb 0 } no_image no_reflection }

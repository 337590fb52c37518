<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="de">
  <context>
    <name>GroundTie</name>
    <message>
      <source>&lt;p&gt;GroundTie needs Python packages that this QGIS does not have: &lt;b&gt;{names}&lt;/b&gt;.&lt;/p&gt;&lt;p&gt;&lt;i&gt;Install&lt;/i&gt; downloads them from the Python Package Index by the command below, into a folder of GroundTie's own: {folder}. QGIS's own packages stay as they are and are preferred. Delete the folder to take everything back.&lt;/p&gt;&lt;p&gt;Or run the command yourself, or on Debian and Ubuntu: &lt;code&gt;{command}&lt;/code&gt;</source>
      <translation>&lt;p&gt;GroundTie braucht Python-Pakete, die dieses QGIS nicht hat: &lt;b&gt;{names}&lt;/b&gt;.&lt;/p&gt;&lt;p&gt;&lt;i&gt;Installieren&lt;/i&gt; lädt sie mit dem Befehl unten aus dem Python Package Index in einen eigenen Ordner von GroundTie: {folder}. QGIS' eigene Pakete bleiben, wie sie sind, und haben Vorrang. Wer den Ordner löscht, macht alles rückgängig.&lt;/p&gt;&lt;p&gt;Oder den Befehl selbst ausführen, oder unter Debian und Ubuntu: &lt;code&gt;{command}&lt;/code&gt;</translation>
    </message>
    <message>
      <source>A SAR image, as amplitude or complex.</source>
      <translation>Ein SAR-Bild, als Amplitude oder komplex.</translation>
    </message>
    <message>
      <source>A coarse shift is searched for on reduced images; SIFT keypoints are matched near where it puts them, and refined by mutual information in chips around them; a robust model is fitted. Parts of the reference are held out of all of this; points in them decide whether the registration is accepted. A refused registration writes no image.</source>
      <translation>Eine grobe Verschiebung wird auf verkleinerten Bildern gesucht; SIFT-Merkmale werden in ihrer Nähe zugeordnet und durch Transinformation in Ausschnitten um sie verfeinert; ein robustes Modell wird angepasst. Teile der Referenz bleiben von alledem ausgenommen; Punkte in ihnen entscheiden, ob die Registrierung angenommen wird. Eine abgelehnte schreibt kein Bild.</translation>
    </message>
    <message>
      <source>A coarse shift is searched for on reduced images; keypoints are matched near where it puts them, and chips all over the images near where the model of the keypoints does; the final model is fitted to the chips. Parts of the reference are held out of all of this; points in them decide whether the registration is accepted. A refused registration writes no image.</source>
      <translation>Eine grobe Verschiebung wird auf verkleinerten Bildern gesucht; Merkmale werden in ihrer Nähe zugeordnet, und Ausschnitte überall in den Bildern nahe dem Modell der Merkmale; das endgültige Modell wird an die Ausschnitte angepasst. Teile der Referenz bleiben von alledem ausgenommen; Punkte in ihnen entscheiden, ob die Registrierung angenommen wird. Eine abgelehnte schreibt kein Bild.</translation>
    </message>
    <message>
      <source>A coarse shift is searched for within the search radius, tie points are matched in chips, and a robust model is fitted to them. Parts of the reference are held out of all of this; points in them decide whether the registration is accepted. A refused registration writes no image.</source>
      <translation>Eine grobe Verschiebung wird im Suchradius gesucht, Verknüpfungspunkte werden in Ausschnitten zugeordnet, und ein robustes Modell wird an sie angepasst. Teile der Referenz bleiben von alledem ausgenommen; Punkte in ihnen entscheiden, ob die Registrierung angenommen wird. Eine abgelehnte schreibt kein Bild.</translation>
    </message>
    <message>
      <source>A date that is added later is registered alone. Without georeferencing, distances are in pixels.</source>
      <translation>Eine Aufnahme, die später dazukommt, wird allein registriert. Ohne Georeferenz sind Entfernungen in Pixeln.</translation>
    </message>
    <message>
      <source>A page that shows errors before and after and how far to trust them; its numbers are put beside it as JSON. It is written for refused RPCs, too.</source>
      <translation>Eine Seite, die Fehler vorher und nachher zeigt und wie weit man ihnen trauen kann; ihre Zahlen kommen als JSON daneben. Sie wird auch für abgelehnte RPCs geschrieben.</translation>
    </message>
    <message>
      <source>A page that shows the result and how far to trust it; its numbers are put beside it as JSON. It is written for a refused registration, too.</source>
      <translation>Eine Seite, die das Ergebnis zeigt und wie weit man ihm trauen kann; ihre Zahlen kommen als JSON daneben. Sie wird auch für eine abgelehnte Registrierung geschrieben.</translation>
    </message>
    <message>
      <source>A page with the errors and, if both images are given, swipe and checkerboard; its numbers are put beside it as JSON. It is written for a refusal, too.</source>
      <translation>Eine Seite mit den Fehlern und, wenn beide Bilder angegeben sind, Wischen und Schachbrett; ihre Zahlen kommen als JSON daneben. Sie wird auch bei einer Ablehnung geschrieben.</translation>
    </message>
    <message>
      <source>A push-broom camera in orbit looks at a scene with terrain and buildings; its image is not orthorectified. The RPCs in the image's tags are wrong by an error of attitude, those in exact_rpc.txt are right. The SAR image of the same ground lies on the map.</source>
      <translation>Eine Zeilenkamera in einer Umlaufbahn blickt auf eine Szene mit Gelände und Gebäuden; ihr Bild ist nicht orthorektifiziert. Die RPCs in den Tags des Bildes sind durch einen Lagefehler falsch, die in exact_rpc.txt stimmen. Das SAR-Bild desselben Bodens liegt auf der Karte.</translation>
    </message>
    <message>
      <source>A raster whose values give the class of features: a cloud mask.</source>
      <translation>Ein Raster, dessen Werte die Klasse der Merkmale angeben: eine Wolkenmaske.</translation>
    </message>
    <message>
      <source>A raster whose zeros take no part, a vector layer of what takes part (polygons, and lines as 11 m wide), or a classifier of train_feature_classifier (.json).</source>
      <translation>Ein Raster, dessen Nullen nicht teilnehmen, ein Vektorlayer dessen, was teilnimmt (Polygone, und Linien als 11 m breite), oder ein Klassifikator von train_feature_classifier (.json).</translation>
    </message>
    <message>
      <source>A row for each run, with a column for each parameter that is given, by its name on the command line or in Python, and perhaps a column name. Paths of inputs begin at the folder of the table.</source>
      <translation>Eine Zeile für jeden Lauf, mit einer Spalte für jeden angegebenen Parameter, nach seinem Namen auf der Befehlszeile oder in Python, und vielleicht einer Spalte name. Pfade von Eingaben beginnen beim Ordner der Tabelle.</translation>
    </message>
    <message>
      <source>A series to one reference, without strong scatterers</source>
      <translation>Eine Serie auf eine Referenz, ohne starke Streuer</translation>
    </message>
    <message>
      <source>A support vector machine learns to separate features that are to be kept from others, by the image around them. Features are found in the image and labelled by what a raster or polygons give for the patch around them: a quarter of it is enough to be left out. A layer's points are taken as they are, and both their classes count alike. The classifier is for images of the same kind: the same bands, units and about the same pixel size.</source>
      <translation>Eine Support Vector Machine lernt, Merkmale, die bleiben sollen, von anderen zu trennen, nach dem Bild um sie herum. Merkmale werden im Bild gefunden und nach dem eingeteilt, was ein Raster oder Polygone für den Fleck um sie angeben: ein Viertel davon reicht, um weggelassen zu werden. Punkte eines Layers werden genommen, wie sie sind, und beide Klassen zählen gleich. Der Klassifikator gilt für Bilder derselben Art: dieselben Kanäle, Einheiten und etwa dieselbe Pixelgröße.</translation>
    </message>
    <message>
      <source>A transform (.json) or tie points (.gpkg, .geojson, .csv, or .points of the QGIS Georeferencer) of this raster or of another one of the same scene.</source>
      <translation>Eine Transformation (.json) oder Verknüpfungspunkte (.gpkg, .geojson, .csv oder .points des Georeferenzierers von QGIS) dieses Rasters oder eines anderen derselben Szene.</translation>
    </message>
    <message>
      <source>A window of the reference is compared with the input at all shifts around its nominal place. The result is a raster: the pixel of a shift lies where the window's centre lies when it is so shifted, so that the peak lies where the input shows the ground at the reference's centre.</source>
      <translation>Ein Fenster der Referenz wird mit der Eingabe bei allen Verschiebungen um seine Solllage verglichen. Das Ergebnis ist ein Raster: das Pixel einer Verschiebung liegt dort, wo die Mitte des so verschobenen Fensters liegt, so dass der Gipfel dort liegt, wo die Eingabe den Boden der Mitte der Referenz zeigt.</translation>
    </message>
    <message>
      <source>Add a point</source>
      <translation>Punkt hinzufügen</translation>
    </message>
    <message>
      <source>Address of a Dask scheduler, as tcp://host:8786, whose workers do the work instead.</source>
      <translation>Adresse eines Dask-Schedulers, etwa tcp://host:8786, dessen Worker die Arbeit stattdessen tun.</translation>
    </message>
    <message>
      <source>Affine</source>
      <translation>Affin</translation>
    </message>
    <message>
      <source>Affine (degree 1)</source>
      <translation>Affin (Grad 1)</translation>
    </message>
    <message>
      <source>All is installed. GroundTie's tools are ready.</source>
      <translation>Alles ist installiert. GroundTies Werkzeuge sind bereit.</translation>
    </message>
    <message>
      <source>Allow any rotation</source>
      <translation>Jede Drehung zulassen</translation>
    </message>
    <message>
      <source>Amplitude</source>
      <translation>Amplitude</translation>
    </message>
    <message>
      <source>An image in the geometry of its sensor. Its RPCs are in its tags or in a file beside it that GDAL finds (_RPC.TXT, .RPB, DIMAP).</source>
      <translation>Ein Bild in der Geometrie seines Sensors. Seine RPCs stehen in seinen Tags oder in einer Datei daneben, die GDAL findet (_RPC.TXT, .RPB, DIMAP).</translation>
    </message>
    <message>
      <source>An image with RPCs needs a raster file as reference.</source>
      <translation>Ein Bild mit RPCs braucht eine Rasterdatei als Referenz.</translation>
    </message>
    <message>
      <source>Angle between the radar's line of sight and the vertical.</source>
      <translation>Winkel zwischen der Blickrichtung des Radars und der Senkrechten.</translation>
    </message>
    <message>
      <source>Apply</source>
      <translation>Anwenden</translation>
    </message>
    <message>
      <source>Apply a stored transform or tie points to a raster.</source>
      <translation>Eine gespeicherte Transformation oder Verknüpfungspunkte auf ein Raster anwenden.</translation>
    </message>
    <message>
      <source>Ascending</source>
      <translation>Aufsteigend</translation>
    </message>
    <message>
      <source>Ascending: the radar looks east; descending: it looks west.</source>
      <translation>Aufsteigend: das Radar blickt nach Osten; absteigend: nach Westen.</translation>
    </message>
    <message>
      <source>Assess RPCs</source>
      <translation>RPCs beurteilen</translation>
    </message>
    <message>
      <source>Assess a registration</source>
      <translation>Registrierung beurteilen</translation>
    </message>
    <message>
      <source>Asset</source>
      <translation>Asset</translation>
    </message>
    <message>
      <source>Attribute</source>
      <translation>Attribut</translation>
    </message>
    <message>
      <source>Automatic</source>
      <translation>Automatisch</translation>
    </message>
    <message>
      <source>Back (B)</source>
      <translation>Zurück (B)</translation>
    </message>
    <message>
      <source>Band</source>
      <translation>Kanal</translation>
    </message>
    <message>
      <source>Band of the image</source>
      <translation>Kanal des Bildes</translation>
    </message>
    <message>
      <source>Band of the input</source>
      <translation>Kanal der Eingabe</translation>
    </message>
    <message>
      <source>Band of the reference</source>
      <translation>Kanal der Referenz</translation>
    </message>
    <message>
      <source>Band ratios</source>
      <translation>Kanalverhältnisse</translation>
    </message>
    <message>
      <source>Bilinear</source>
      <translation>Bilinear</translation>
    </message>
    <message>
      <source>Binning</source>
      <translation>Klasseneinteilung</translation>
    </message>
    <message>
      <source>Bottom left</source>
      <translation>Unten links</translation>
    </message>
    <message>
      <source>Bottom right</source>
      <translation>Unten rechts</translation>
    </message>
    <message>
      <source>Brightest part masked</source>
      <translation>Hellster Teil, der maskiert wird</translation>
    </message>
    <message>
      <source>By hand</source>
      <translation>Von Hand</translation>
    </message>
    <message>
      <source>CE90 at check points (m)</source>
      <translation>CE90 an Prüfpunkten (m)</translation>
    </message>
    <message>
      <source>CE90 before (m)</source>
      <translation>CE90 vorher (m)</translation>
    </message>
    <message>
      <source>CE90 of the pose (px)</source>
      <translation>CE90 der Lage (px)</translation>
    </message>
    <message>
      <source>CE90 of the transform (m)</source>
      <translation>CE90 der Transformation (m)</translation>
    </message>
    <message>
      <source>CRS</source>
      <translation>KBS</translation>
    </message>
    <message>
      <source>CRS of the result, as EPSG:32632; by default the UTM zone of the image.</source>
      <translation>KBS des Ergebnisses, wie EPSG:32632; ohne Angabe die UTM-Zone des Bildes.</translation>
    </message>
    <message>
      <source>Camera's line of sight from the vertical; relief displacement grows with it.</source>
      <translation>Blickrichtung der Kamera gegen die Senkrechte; mit ihr wächst der Reliefversatz.</translation>
    </message>
    <message>
      <source>Cancel</source>
      <translation>Abbrechen</translation>
    </message>
    <message>
      <source>Centre x</source>
      <translation>Mitte x</translation>
    </message>
    <message>
      <source>Centre y</source>
      <translation>Mitte y</translation>
    </message>
    <message>
      <source>Changed buildings</source>
      <translation>Veränderte Gebäude</translation>
    </message>
    <message>
      <source>Check points</source>
      <translation>Prüfpunkte</translation>
    </message>
    <message>
      <source>Chip size</source>
      <translation>Größe der Bildausschnitte</translation>
    </message>
    <message>
      <source>Choose two raster layers.</source>
      <translation>Zwei Rasterlayer wählen.</translation>
    </message>
    <message>
      <source>Choose what the images are to set the search.</source>
      <translation>Wählen, was die Bilder sind, um die Suche einzustellen.</translation>
    </message>
    <message>
      <source>City</source>
      <translation>Großstadt</translation>
    </message>
    <message>
      <source>Classifier</source>
      <translation>Klassifikator</translation>
    </message>
    <message>
      <source>Close</source>
      <translation>Schließen</translation>
    </message>
    <message>
      <source>Cluster reward</source>
      <translation>Cluster Reward</translation>
    </message>
    <message>
      <source>Co-register a series</source>
      <translation>Serie koregistrieren</translation>
    </message>
    <message>
      <source>Co-register images</source>
      <translation>Bilder koregistrieren</translation>
    </message>
    <message>
      <source>Co-register two images of the same place, above all a SAR and an optical one.</source>
      <translation>Zwei Bilder desselben Ortes koregistrieren, vor allem ein SAR- und ein optisches.</translation>
    </message>
    <message>
      <source>Correlation ratio</source>
      <translation>Korrelationsverhältnis</translation>
    </message>
    <message>
      <source>Correlation with the surface model</source>
      <translation>Korrelation mit dem Oberflächenmodell</translation>
    </message>
    <message>
      <source>Cubic</source>
      <translation>Kubisch</translation>
    </message>
    <message>
      <source>Damping</source>
      <translation>Dämpfung</translation>
    </message>
    <message>
      <source>Darkest part masked</source>
      <translation>Dunkelster Teil, der maskiert wird</translation>
    </message>
    <message>
      <source>Dates</source>
      <translation>Aufnahmen</translation>
    </message>
    <message>
      <source>Dates that were left out</source>
      <translation>Weggelassene Aufnahmen</translation>
    </message>
    <message>
      <source>Dates that were registered</source>
      <translation>Registrierte Aufnahmen</translation>
    </message>
    <message>
      <source>Decided by the images</source>
      <translation>Die Bilder entscheiden</translation>
    </message>
    <message>
      <source>Density</source>
      <translation>Bebauungsdichte</translation>
    </message>
    <message>
      <source>Descending</source>
      <translation>Absteigend</translation>
    </message>
    <message>
      <source>Discrete SPSA</source>
      <translation>Diskretes SPSA</translation>
    </message>
    <message>
      <source>Displacement</source>
      <translation>Versatz</translation>
    </message>
    <message>
      <source>Distortion</source>
      <translation>Verzerrung</translation>
    </message>
    <message>
      <source>Drift</source>
      <translation>Drift</translation>
    </message>
    <message>
      <source>EGM2008</source>
      <translation>EGM2008</translation>
    </message>
    <message>
      <source>EGM96</source>
      <translation>EGM96</translation>
    </message>
    <message>
      <source>Edge strength</source>
      <translation>Kantenstärke</translation>
    </message>
    <message>
      <source>Elevated objects are laid over the ground, hide it and cast shadows: that follows from heights and the angles of view, and is computed by casting rays. Without the view of the image that is to be registered, only what the reference itself does not show is masked. `coregister`, `extract_gcps` and `refine_rpc` make the same mask themselves if given a surface model.</source>
      <translation>Erhöhte Objekte legen sich über den Boden, verdecken ihn und werfen Schatten: das folgt aus Höhen und Blickwinkeln und wird durch Strahlverfolgung berechnet. Ohne die Blickrichtung des Bildes, das registriert werden soll, wird nur maskiert, was die Referenz selbst nicht zeigt. `coregister`, `extract_gcps` und `refine_rpc` machen dieselbe Maske selbst, wenn ein Oberflächenmodell angegeben ist.</translation>
    </message>
    <message>
      <source>Ellipsoid</source>
      <translation>Ellipsoid</translation>
    </message>
    <message>
      <source>Enhanced Frost</source>
      <translation>Enhanced Frost</translation>
    </message>
    <message>
      <source>Equal frequency</source>
      <translation>Gleiche Häufigkeit</translation>
    </message>
    <message>
      <source>Equivalent number of looks</source>
      <translation>Äquivalente Zahl der Looks</translation>
    </message>
    <message>
      <source>Equivalent number of looks of the result</source>
      <translation>Äquivalente Zahl der Looks des Ergebnisses</translation>
    </message>
    <message>
      <source>Equivalent number of looks; by default it is estimated from the image.</source>
      <translation>Äquivalente Zahl der Looks; ohne Angabe wird sie aus dem Bild geschätzt.</translation>
    </message>
    <message>
      <source>Error at check points (px)</source>
      <translation>Fehler an Prüfpunkten (px)</translation>
    </message>
    <message>
      <source>Error at control points (px)</source>
      <translation>Fehler an Ausgleichspunkten (px)</translation>
    </message>
    <message>
      <source>Error at held-out points (px)</source>
      <translation>Fehler an zurückgehaltenen Punkten (px)</translation>
    </message>
    <message>
      <source>Error at test points (px)</source>
      <translation>Fehler an Testpunkten (px)</translation>
    </message>
    <message>
      <source>Error before (m)</source>
      <translation>Fehler vorher (m)</translation>
    </message>
    <message>
      <source>Error before (px)</source>
      <translation>Fehler vorher (px)</translation>
    </message>
    <message>
      <source>Error of the terrain</source>
      <translation>Fehler des Geländes</translation>
    </message>
    <message>
      <source>Errors are measured at control points (no measure of accuracy), at test points, at independent check points, and as the consistency of several transforms: RMSE, mean, median, CE90, largest, bias and standard deviation, in input pixels and metres. Only points that took no part in the fit can confirm a registration; inconsistency can refuse it, too.</source>
      <translation>Fehler werden gemessen an Ausgleichspunkten (kein Maß der Genauigkeit), an Testpunkten, an unabhängigen Prüfpunkten und als Konsistenz mehrerer Transformationen: RMSE, Mittel, Median, CE90, größter Fehler, systematischer Fehler und Standardabweichung, in Pixeln der Eingabe und Metern. Nur Punkte, die nicht am Ausgleich teilnahmen, können eine Registrierung bestätigen; auch Inkonsistenz kann sie ablehnen.</translation>
    </message>
    <message>
      <source>Errors on the ground are measured at the points' own heights; points without heights take them from the terrain model. All used points count, however large their errors.</source>
      <translation>Fehler am Boden werden in den eigenen Höhen der Punkte gemessen; Punkte ohne Höhen nehmen sie aus dem Geländemodell. Alle benutzten Punkte zählen, wie groß ihre Fehler auch sind.</translation>
    </message>
    <message>
      <source>Estimate rotation and scale</source>
      <translation>Drehung und Maßstab schätzen</translation>
    </message>
    <message>
      <source>Estimate rotation, scale and shift between two rasters of the same place.</source>
      <translation>Drehung, Maßstab und Verschiebung zwischen zwei Rastern desselben Ortes schätzen.</translation>
    </message>
    <message>
      <source>Every date is registered to the reference and to its neighbours in time; one adjustment of this network by least squares gives each date's transform. A date that the reference refuses is reached by others. Ways around three dates must lead back to their start. Dates of another place, under clouds or too far off are named and left out; the others stand.</source>
      <translation>Jede Aufnahme wird auf die Referenz und auf ihre zeitlichen Nachbarn registriert; ein Ausgleich dieses Netzes nach kleinsten Quadraten gibt die Transformation jeder Aufnahme. Eine Aufnahme, die die Referenz ablehnt, wird über andere erreicht. Wege um drei Aufnahmen müssen zu ihrem Anfang zurückführen. Aufnahmen eines anderen Ortes, unter Wolken oder zu weit daneben werden genannt und weggelassen; die anderen bleiben.</translation>
    </message>
    <message>
      <source>Every pixel of the map is looked up in the image where the RPCs see the ground at the height that the terrain model has there. All bands are resampled once. Pixels that the image does not see, or whose height is not known, hold no data. Places that others hide, as behind houses in a surface model, show what hides them.</source>
      <translation>Jedes Pixel der Karte wird im Bild dort aufgesucht, wo die RPCs den Boden in der Höhe sehen, die das Geländemodell dort hat. Alle Kanäle werden einmal neu abgetastet. Pixel, die das Bild nicht sieht oder deren Höhe unbekannt ist, haben keine Daten. Orte, die andere verdecken, wie hinter Häusern in einem Oberflächenmodell, zeigen, was sie verdeckt.</translation>
    </message>
    <message>
      <source>Exact</source>
      <translation>Exakt</translation>
    </message>
    <message>
      <source>Extract ground control</source>
      <translation>Passpunkte gewinnen</translation>
    </message>
    <message>
      <source>Extract ground control for an image with RPCs from a reference image and a terrain model.</source>
      <translation>Passpunkte für ein Bild mit RPCs aus einem Referenzbild und einem Geländemodell gewinnen.</translation>
    </message>
    <message>
      <source>Features are circles as large as their scale. Those of both images correspond if their circles overlap; the smaller the error of the overlap, the better they repeat. Features are then matched by their descriptors alone, and the worst matches dropped until the rest agree on an affine model.</source>
      <translation>Merkmale sind Kreise von der Größe ihres Maßstabs. Die beider Bilder entsprechen sich, wenn ihre Kreise überlappen; je kleiner der Fehler der Überlappung, desto besser wiederholen sie sich. Merkmale werden dann allein nach ihren Deskriptoren zugeordnet, und die schlechtesten Zuordnungen fallen weg, bis die übrigen zu einem affinen Modell passen.</translation>
    </message>
    <message>
      <source>Filter</source>
      <translation>Filter</translation>
    </message>
    <message>
      <source>Filter speckle</source>
      <translation>Speckle filtern</translation>
    </message>
    <message>
      <source>Filtered image</source>
      <translation>Gefiltertes Bild</translation>
    </message>
    <message>
      <source>Filters work on intensity: amplitudes are squared before and the root is taken after, so that the mean power stays. Each band is filtered by itself; pixels without data are left out.</source>
      <translation>Filter arbeiten auf der Intensität: Amplituden werden vorher quadriert, und danach wird die Wurzel gezogen, so dass die mittlere Leistung bleibt. Jeder Kanal wird für sich gefiltert; Pixel ohne Daten nehmen nicht teil.</translation>
    </message>
    <message>
      <source>Flicker</source>
      <translation>Blinken</translation>
    </message>
    <message>
      <source>Folder</source>
      <translation>Ordner</translation>
    </message>
    <message>
      <source>For mlmi: number of pixels of the window that are used.</source>
      <translation>Für mlmi: Zahl der Pixel des Fensters, die benutzt werden.</translation>
    </message>
    <message>
      <source>For the tools that register images.</source>
      <translation>Für die Werkzeuge, die Bilder registrieren.</translation>
    </message>
    <message>
      <source>For three-way consistency, in place of the closing transform: the registration of the third image to the reference; its inverse is taken.</source>
      <translation>Für die Konsistenz über drei Wege, statt der schließenden Transformation: die Registrierung des dritten Bildes auf die Referenz; genommen wird ihre Umkehrung.</translation>
    </message>
    <message>
      <source>For three-way consistency: the registration of a third image to the input (the input is its reference). It needs the transform closing or direct, too.</source>
      <translation>Für die Konsistenz über drei Wege: die Registrierung eines dritten Bildes auf die Eingabe (die Eingabe ist seine Referenz). Sie braucht auch die schließende oder die direkte Transformation.</translation>
    </message>
    <message>
      <source>For three-way consistency: the registration of the reference to the third image (the third image is its reference).</source>
      <translation>Für die Konsistenz über drei Wege: die Registrierung der Referenz auf das dritte Bild (das dritte Bild ist ihre Referenz).</translation>
    </message>
    <message>
      <source>Fourier–Mellin</source>
      <translation>Fourier–Mellin</translation>
    </message>
    <message>
      <source>From where both images were taken, for the surface model: STAC items or products' metadata (.json, .xml, .imd), or words, that of the reference first, as in 'radar azimuth=280 incidence=35; camera azimuth=250 incidence=12 sun-azimuth=155 sun-elevation=48'. Azimuths from the ground to the sensor or sun, clockwise from north, incidence from the vertical. By default what lies beside each image: a STAC item of its own name, or its product's metadata.</source>
      <translation>Von wo beide Bilder aufgenommen wurden, für das Oberflächenmodell: STAC-Items oder Metadaten der Produkte (.json, .xml, .imd) oder Worte, die der Referenz zuerst, wie in 'radar azimuth=280 incidence=35; camera azimuth=250 incidence=12 sun-azimuth=155 sun-elevation=48'. Azimute vom Boden zum Sensor oder zur Sonne, im Uhrzeigersinn von Norden, der Einfallswinkel von der Senkrechten. Ohne Angabe gilt, was neben jedem Bild liegt: ein STAC-Item seines Namens oder die Metadaten seines Produkts.</translation>
    </message>
    <message>
      <source>From where both images were taken, for the surface model: STAC items or products' metadata (.json, .xml, .imd), or words, that of the reference first, as in 'radar azimuth=280 incidence=35; camera azimuth=250 incidence=12 sun-azimuth=155 sun-elevation=48'. Azimuths from the ground to the sensor or sun, clockwise from north, incidence from the vertical. By default what lies beside each image: a STAC item of its own name, or its product's metadata. If the reference is a terrain model, how it is rendered: 'terrain sun azimuth=155' for a camera's image, 'terrain radar' for a radar's; without azimuth a radar stands in the west, and register tries azimuths. If it is a surface model of a town, 'surface radar azimuth=280 incidence=35' for a radar image; 'surface radar' takes these from the input's metadata.</source>
      <translation>Von wo beide Bilder aufgenommen wurden, für das Oberflächenmodell: STAC-Items oder Metadaten der Produkte (.json, .xml, .imd) oder Worte, die der Referenz zuerst, wie in 'radar azimuth=280 incidence=35; camera azimuth=250 incidence=12 sun-azimuth=155 sun-elevation=48'. Azimute vom Boden zum Sensor oder zur Sonne, im Uhrzeigersinn von Norden, der Einfallswinkel von der Senkrechten. Ohne Angabe gilt, was neben jedem Bild liegt: ein STAC-Item seines Namens oder die Metadaten seines Produkts. Ist die Referenz ein Geländemodell, wie es gerendert wird: 'terrain sun azimuth=155' für ein Kamerabild, 'terrain radar' für ein Radarbild; ohne azimuth steht ein Radar im Westen, und register probiert Azimute. Ist sie ein Oberflächenmodell einer Stadt, 'surface radar azimuth=280 incidence=35' für ein Radarbild; 'surface radar' nimmt die Angaben aus den Metadaten der Eingabe.</translation>
    </message>
    <message>
      <source>Gamma MAP</source>
      <translation>Gamma MAP</translation>
    </message>
    <message>
      <source>Gaussian (RBF)</source>
      <translation>Gauß (RBF)</translation>
    </message>
    <message>
      <source>GeoTIFF of three bands over the overlap: by how much the input is moved to the east and to the north, and the standard deviation of that; in metres, without georeferencing in pixels to the right and down.</source>
      <translation>GeoTIFF mit drei Kanälen über der Überlappung: um wie viel die Eingabe nach Osten und nach Norden bewegt wird, und die Standardabweichung davon; in Metern, ohne Georeferenz in Pixeln nach rechts und unten.</translation>
    </message>
    <message>
      <source>GeoTIFF that is 1 on homogeneous regions whose shape is that of roads, waters, fields or squares.</source>
      <translation>GeoTIFF, das 1 ist auf homogenen Regionen mit der Form von Straßen, Gewässern, Feldern oder Plätzen.</translation>
    </message>
    <message>
      <source>GeoTIFF that is 1 on the skeleton of long regions.</source>
      <translation>GeoTIFF, das auf dem Skelett langer Regionen 1 ist.</translation>
    </message>
    <message>
      <source>GeoTIFF that is 1 where pixels take part and 0 elsewhere.</source>
      <translation>GeoTIFF, das 1 ist, wo Pixel teilnehmen, und sonst 0.</translation>
    </message>
    <message>
      <source>GeoTIFF with a pixel for every shift; its first band has the measure's values, the second one robust standard deviations from the slow trend.</source>
      <translation>GeoTIFF mit einem Pixel für jede Verschiebung; der erste Kanal hat die Werte des Maßes, der zweite robuste Standardabweichungen vom langsamen Verlauf.</translation>
    </message>
    <message>
      <source>GeoTIFF with the image's bands, data type, nodata value, colours and metadata. A name that ends in .cog.tif makes it a Cloud Optimized GeoTIFF.</source>
      <translation>GeoTIFF mit den Kanälen, dem Datentyp, dem Nodata-Wert, den Farben und Metadaten des Bildes. Ein Name, der auf .cog.tif endet, macht es zu einem Cloud Optimized GeoTIFF.</translation>
    </message>
    <message>
      <source>GeoTIFF with the input's bands, data type and nodata value; complex images become amplitudes.</source>
      <translation>GeoTIFF mit den Kanälen, dem Datentyp und dem Nodata-Wert der Eingabe; komplexe Bilder werden zu Amplituden.</translation>
    </message>
    <message>
      <source>GeoTIFF with the input's bands, data type, nodata value, colours and metadata. A name that ends in .cog.tif makes it a Cloud Optimized GeoTIFF.</source>
      <translation>GeoTIFF mit den Kanälen, dem Datentyp, dem Nodata-Wert, den Farben und Metadaten der Eingabe. Ein Name, der auf .cog.tif endet, macht es zu einem Cloud Optimized GeoTIFF.</translation>
    </message>
    <message>
      <source>GeoTIFF with the input's bands, data type, nodata value, colours and metadata. A name that ends in .cog.tif makes it a Cloud Optimized GeoTIFF. A .vrt, for a shift alone, puts the input's own file in its right place: no pixel is written.</source>
      <translation>GeoTIFF mit den Kanälen, dem Datentyp, dem Nodata-Wert, den Farben und Metadaten der Eingabe. Ein Name, der auf .cog.tif endet, macht es zu einem Cloud Optimized GeoTIFF. Eine .vrt legt bei reiner Verschiebung die eigene Datei der Eingabe an ihren richtigen Ort: kein Pixel wird geschrieben.</translation>
    </message>
    <message>
      <source>GeoTIFF with why each pixel takes no part, as a sum: 1 raised, 2 layover, 4 radar shadow, 8 hidden from the camera, 16 cast shadow, 32 unknown.</source>
      <translation>GeoTIFF mit dem Grund, warum jedes Pixel nicht teilnimmt, als Summe: 1 erhöht, 2 Layover, 4 Radarschatten, 8 der Kamera verdeckt, 16 Schlagschatten, 32 unbekannt.</translation>
    </message>
    <message>
      <source>Geoid grid</source>
      <translation>Geoidgitter</translation>
    </message>
    <message>
      <source>Gets reference.tif (SAR), input.tif (optical), dem.tif, dsm.tif, reference.json and input.json (view angles), truth.json, check_points.csv and roof_points.csv; input_dem.tif where the terrain has an error.</source>
      <translation>Bekommt reference.tif (SAR), input.tif (optisch), dem.tif, dsm.tif, reference.json und input.json (Blickwinkel), truth.json, check_points.csv und roof_points.csv; input_dem.tif, wenn das Gelände einen Fehler hat.</translation>
    </message>
    <message>
      <source>Gets sensor.tif (optical, with RPCs), reference.tif (SAR), dem.tif, dsm.tif, reference.json and sensor.json (view angles), exact_rpc.txt, truth.json, check_points.csv and roof_points.csv.</source>
      <translation>Bekommt sensor.tif (optisch, mit RPCs), reference.tif (SAR), dem.tif, dsm.tif, reference.json und sensor.json (Blickwinkel), exact_rpc.txt, truth.json, check_points.csv und roof_points.csv.</translation>
    </message>
    <message>
      <source>Give a mask of level ground where there are high buildings or hills: layover displaces them. Images without georeferencing are matched in pixel coordinates and may have any rotation; distances are then in pixels.</source>
      <translation>Wo hohe Gebäude oder Berge stehen, eine Maske ebenen Bodens angeben: Layover verschiebt sie. Bilder ohne Georeferenz werden in Pixelkoordinaten zugeordnet und dürfen beliebig gedreht sein; Entfernungen sind dann in Pixeln.</translation>
    </message>
    <message>
      <source>Grey values</source>
      <translation>Grauwerte</translation>
    </message>
    <message>
      <source>Grid of the registered image: the reference's pixels exactly, so that both stack; pixels like the input's own; or, for a pure shift, the input's untouched pixels with a corrected geotransform. The last two reach beyond the overlap, where nothing has checked the transform.</source>
      <translation>Gitter des registrierten Bildes: genau die Pixel der Referenz, so dass beide aufeinanderliegen; Pixel wie die der Eingabe; oder, bei reiner Verschiebung, die unberührten Pixel der Eingabe mit korrigierter Georeferenz. Die beiden letzten reichen über die Überlappung hinaus, wo nichts die Transformation geprüft hat.</translation>
    </message>
    <message>
      <source>Ground control points</source>
      <translation>Passpunkte</translation>
    </message>
    <message>
      <source>Ground lies apart from layover and radar shadow: behind the shadow of one building and before the layover of the next. The mask is for the registration of this image; `coregister` makes the same one itself of a town.</source>
      <translation>Der Boden liegt abseits von Layover und Radarschatten: hinter dem Schatten des einen Gebäudes und vor dem Layover des nächsten. Die Maske ist für die Registrierung dieses Bildes; `coregister` macht dieselbe bei einer Stadt selbst.</translation>
    </message>
    <message>
      <source>GroundTie cannot use a Python package: {}</source>
      <translation>GroundTie kann ein Python-Paket nicht benutzen: {}</translation>
    </message>
    <message>
      <source>GroundTie needs the Python package {names}, which QGIS's Python does not have: take Raster &gt; GroundTie &gt; Install what is missing, or run: {command} (then restart QGIS)</source>
      <translation>GroundTie braucht das Python-Paket {names}, das QGIS' Python nicht hat: Raster &gt; GroundTie &gt; Fehlendes installieren wählen, oder ausführen: {command} (danach QGIS neu starten)</translation>
    </message>
    <message>
      <source>GroundTie needs the Python packages {names}, which QGIS's Python does not have: take Raster &gt; GroundTie &gt; Install what is missing, or run: {command} (then restart QGIS)</source>
      <translation>GroundTie braucht die Python-Pakete {names}, die QGIS' Python nicht hat: Raster &gt; GroundTie &gt; Fehlendes installieren wählen, oder ausführen: {command} (danach QGIS neu starten)</translation>
    </message>
    <message>
      <source>GroundTie: install what is missing</source>
      <translation>GroundTie: Fehlendes installieren</translation>
    </message>
    <message>
      <source>Growth of what is masked</source>
      <translation>Wachstum des Maskierten</translation>
    </message>
    <message>
      <source>Heading</source>
      <translation>Flugrichtung</translation>
    </message>
    <message>
      <source>Height</source>
      <translation>Höhe</translation>
    </message>
    <message>
      <source>Height above the ellipsoid that holds everywhere without a terrain model; by default the RPCs' own.</source>
      <translation>Höhe über dem Ellipsoid, die ohne Geländemodell überall gilt; ohne Angabe die der RPCs.</translation>
    </message>
    <message>
      <source>Height of the peak (standard deviations)</source>
      <translation>Höhe des Gipfels (Standardabweichungen)</translation>
    </message>
    <message>
      <source>Height of the result in pixels</source>
      <translation>Höhe des Ergebnisses in Pixeln</translation>
    </message>
    <message>
      <source>Height over chance</source>
      <translation>Höhe über dem Zufall</translation>
    </message>
    <message>
      <source>Height over that of the best elsewhere</source>
      <translation>Höhe gegenüber dem besten anderen Ort</translation>
    </message>
    <message>
      <source>Heights above</source>
      <translation>Höhen über</translation>
    </message>
    <message>
      <source>Heights of another geoid above the ellipsoid, in place of a vertical datum by name.</source>
      <translation>Höhen eines anderen Geoids über dem Ellipsoid, statt eines Höhenbezugs mit Namen.</translation>
    </message>
    <message>
      <source>Heights of roofs, canopies and ground (DSM), or a vector layer of buildings with a field height in metres.</source>
      <translation>Höhen von Dächern, Baumkronen und Boden (DSM), oder ein Vektorlayer von Gebäuden mit einem Feld height in Metern.</translation>
    </message>
    <message>
      <source>Heights of roofs, canopies and ground (DSM), or a vector layer of buildings with a field height in metres. Only ground that both images show takes part: no layover, radar shadow, relief displacement or cast shadow. Needs the views of both images.</source>
      <translation>Höhen von Dächern, Baumkronen und Boden (DSM), oder ein Vektorlayer von Gebäuden mit einem Feld height in Metern. Nur Boden, den beide Bilder zeigen, nimmt teil: kein Layover, Radarschatten, Reliefversatz oder Schlagschatten. Braucht die Blickrichtungen beider Bilder.</translation>
    </message>
    <message>
      <source>Heights of the ground, in any CRS. Where the input was orthorectified with others, or with one height, it is displaced in proportion to the difference: model auto may take this out, too, if the points justify it.</source>
      <translation>Höhen des Bodens, in beliebigem KBS. Wo die Eingabe mit anderen oder mit einer einzigen Höhe orthorektifiziert wurde, ist sie im Verhältnis zum Unterschied versetzt: das Modell auto darf auch das herausnehmen, wenn die Punkte es rechtfertigen.</translation>
    </message>
    <message>
      <source>Heights of the ground, in any CRS; voids are filled from their rims. Without it, one height holds everywhere.</source>
      <translation>Höhen des Bodens, in beliebigem KBS; Lücken werden von ihren Rändern her gefüllt. Ohne es gilt überall eine Höhe.</translation>
    </message>
    <message>
      <source>Help</source>
      <translation>Hilfe</translation>
    </message>
    <message>
      <source>Histogram bins</source>
      <translation>Histogrammklassen</translation>
    </message>
    <message>
      <source>How far off on the ground the RPCs are; the direction is drawn.</source>
      <translation>Wie weit die RPCs am Boden daneben liegen; die Richtung wird ausgelost.</translation>
    </message>
    <message>
      <source>How far the RPCs may be wrong on the ground. By default 100 m or 20 pixels of the coarser image, whichever is larger. No hard limit: finer stages look some 20 pixels further, those of images reduced to 512 pixels where they are larger.</source>
      <translation>Wie weit die RPCs am Boden falsch sein können. Ohne Angabe 100 m oder 20 Pixel des gröberen Bildes, je nachdem, was größer ist. Keine feste Grenze: Feinere Stufen suchen rund 20 Pixel weiter, bei größeren Bildern Pixel der auf 512 Pixel verkleinerten.</translation>
    </message>
    <message>
      <source>How far the input may be rotated, either way, against its nominal geotransform. By default not at all; match_sar_sar and match_optical search any rotation where there is no georeferencing.</source>
      <translation>Wie weit die Eingabe gegen ihre Georeferenz gedreht sein kann, in beiden Richtungen. Ohne Angabe gar nicht; match_sar_sar und match_optical suchen jede Drehung, wo keine Georeferenz ist.</translation>
    </message>
    <message>
      <source>How far the input may lie from its nominal position, along rows and columns; without georeferencing, how far the images' centres are apart, in input pixels. By default a quarter of the input's longer side.</source>
      <translation>Wie weit die Eingabe von ihrer Solllage liegen kann, entlang von Zeilen und Spalten; ohne Georeferenz, wie weit die Bildmitten auseinanderliegen, in Pixeln der Eingabe. Ohne Angabe ein Viertel der längeren Seite der Eingabe.</translation>
    </message>
    <message>
      <source>How far the input may lie from its right place. By default 100 m or 20 pixels of the coarser image, whichever is larger; match_sar_sar and match_optical search a quarter of the input's longer side where there is no georeferencing. No hard limit: finer stages look some 20 pixels further, those of images reduced to 512 pixels where they are larger.</source>
      <translation>Wie weit die Eingabe von ihrem richtigen Ort liegen kann. Ohne Angabe 100 m oder 20 Pixel des gröberen Bildes, je nachdem, was größer ist; match_sar_sar und match_optical suchen ein Viertel der längeren Seite der Eingabe, wo keine Georeferenz ist. Keine feste Grenze: Feinere Stufen suchen rund 20 Pixel weiter, bei größeren Bildern Pixel der auf 512 Pixel verkleinerten.</translation>
    </message>
    <message>
      <source>How far the optical image is off; the direction is drawn.</source>
      <translation>Wie weit das optische Bild daneben liegt; die Richtung wird ausgelost.</translation>
    </message>
    <message>
      <source>How far they are rotated about the centre of the image.</source>
      <translation>Wie weit sie um die Bildmitte gedreht sind.</translation>
    </message>
    <message>
      <source>How much of the scene is built up: rural up to 3 %, suburban up to 25 %, urban about half, with high buildings; city has streets with cars, courtyards and towers.</source>
      <translation>Wie viel der Szene bebaut ist: ländlich bis 3 %, vorstädtisch bis 25 %, städtisch etwa die Hälfte, mit hohen Gebäuden; die Großstadt hat Straßen mit Autos, Höfe und Türme.</translation>
    </message>
    <message>
      <source>How much their error changes from the first line of the image to the last.</source>
      <translation>Wie sehr sich ihr Fehler von der ersten bis zur letzten Zeile des Bildes ändert.</translation>
    </message>
    <message>
      <source>How the pose is searched for: rotation-steps, which all registrations use, tries everything and is the only one that is meant for SAR with optical images. The others are there to compare: fourier-mellin finds any rotation and scale, radon rotations, phase-correlation shifts alone; the rest climb mutual information from the nominal position.</source>
      <translation>Wie die Lage gesucht wird: Drehschritte, die alle Registrierungen benutzen, probieren alles und sind als einzige für SAR mit optischen Bildern gedacht. Die anderen sind zum Vergleich da: Fourier–Mellin findet jede Drehung und jeden Maßstab, Radon Drehungen, Phasenkorrelation nur Verschiebungen; die übrigen steigen von der Solllage aus zu größerer Transinformation.</translation>
    </message>
    <message>
      <source>How values between the input's pixels are found. Where output pixels are larger than 1.5 input pixels, the mean of the area is taken first, but for nearest. Images with a palette are always resampled by nearest.</source>
      <translation>Wie Werte zwischen den Pixeln der Eingabe gefunden werden. Wo Ausgabepixel größer als 1,5 Pixel der Eingabe sind, wird zuerst das Mittel der Fläche genommen, nur nicht beim nächsten Nachbarn. Bilder mit Farbpalette werden immer nach dem nächsten Nachbarn abgetastet.</translation>
    </message>
    <message>
      <source>How well all poses match, and the images on one another; it is drawn for a refused pose, too.</source>
      <translation>Wie gut alle Lagen passen, und die Bilder aufeinander; es wird auch für eine abgelehnte Lage gezeichnet.</translation>
    </message>
    <message>
      <source>ISEF</source>
      <translation>ISEF</translation>
    </message>
    <message>
      <source>If the reference is a terrain model, how it is rendered: 'terrain sun azimuth=155' for a camera's image, 'terrain radar' for a radar's; without azimuth a radar stands in the west, and register tries azimuths. If it is a surface model of a town, 'surface radar azimuth=280 incidence=35' for a radar image; 'surface radar' takes these from the input's metadata.</source>
      <translation>Ist die Referenz ein Geländemodell, wie es gerendert wird: 'terrain sun azimuth=155' für ein Kamerabild, 'terrain radar' für ein Radarbild; ohne azimuth steht ein Radar im Westen, und register probiert Azimute. Ist sie ein Oberflächenmodell einer Stadt, 'surface radar azimuth=280 incidence=35' für ein Radarbild; 'surface radar' nimmt die Angaben aus den Metadaten der Eingabe.</translation>
    </message>
    <message>
      <source>Image</source>
      <translation>Bild</translation>
    </message>
    <message>
      <source>Image with RPCs</source>
      <translation>Bild mit RPCs</translation>
    </message>
    <message>
      <source>Images</source>
      <translation>Bilder</translation>
    </message>
    <message>
      <source>Images of one place: files, folders, patterns, CSV tables with a column file, STAC items (.json).</source>
      <translation>Bilder eines Ortes: Dateien, Ordner, Muster, CSV-Tabellen mit einer Spalte file, STAC-Items (.json).</translation>
    </message>
    <message>
      <source>Images with georeferencing are compared at their nominal positions: what is found is by how much the input is rotated, scaled and shifted against that. Images without it are compared pixel by pixel, from centre to centre. Large images are reduced to some 500 pixels, so that what is found is a start for a registration, not its end.</source>
      <translation>Bilder mit Georeferenz werden an ihren Solllagen verglichen: gefunden wird, wie weit die Eingabe dagegen gedreht, skaliert und verschoben ist. Bilder ohne sie werden Pixel für Pixel verglichen, von Mitte zu Mitte. Große Bilder werden auf etwa 500 Pixel verkleinert; was gefunden wird, ist darum der Anfang einer Registrierung, nicht ihr Ende.</translation>
    </message>
    <message>
      <source>Images without georeferencing are matched in pixel coordinates and may have any rotation and a scale of up to 2; distances are then in pixels.</source>
      <translation>Bilder ohne Georeferenz werden in Pixelkoordinaten zugeordnet und dürfen beliebig gedreht und bis zum Faktor 2 skaliert sein; Entfernungen sind dann in Pixeln.</translation>
    </message>
    <message>
      <source>Incidence angle</source>
      <translation>Einfallswinkel</translation>
    </message>
    <message>
      <source>Information</source>
      <translation>Auskunft</translation>
    </message>
    <message>
      <source>Input</source>
      <translation>Eingabe</translation>
    </message>
    <message>
      <source>Input image</source>
      <translation>Eingabebild</translation>
    </message>
    <message>
      <source>Input's pixels untouched, geotransform corrected</source>
      <translation>Pixel der Eingabe unberührt, Georeferenz korrigiert</translation>
    </message>
    <message>
      <source>Install</source>
      <translation>Installieren</translation>
    </message>
    <message>
      <source>Install what is missing…</source>
      <translation>Fehlendes installieren…</translation>
    </message>
    <message>
      <source>Intensity</source>
      <translation>Intensität</translation>
    </message>
    <message>
      <source>It stays where you clicked: {}.</source>
      <translation>Er bleibt, wo Sie geklickt haben: {}.</translation>
    </message>
    <message>
      <source>JSON lines, one when a row ends; by default TABLE.log.jsonl in the output folder.</source>
      <translation>JSON-Zeilen, eine, wenn eine Zeile endet; ohne Angabe TABELLE.log.jsonl im Ausgabeordner.</translation>
    </message>
    <message>
      <source>Judge the RPCs of an image at independent check points, before and after a refinement.</source>
      <translation>Die RPCs eines Bildes an unabhängigen Prüfpunkten beurteilen, vor und nach einer Verbesserung.</translation>
    </message>
    <message>
      <source>Kernel</source>
      <translation>Kern</translation>
    </message>
    <message>
      <source>Kuan</source>
      <translation>Kuan</translation>
    </message>
    <message>
      <source>Labelled layer</source>
      <translation>Layer mit Klassen</translation>
    </message>
    <message>
      <source>Labelled raster</source>
      <translation>Raster mit Klassen</translation>
    </message>
    <message>
      <source>Lanczos</source>
      <translation>Lanczos</translation>
    </message>
    <message>
      <source>Largest displacement besides the shift, for distortions affine and polynomial; by default 4 px, less in images below 80 px.</source>
      <translation>Größter Versatz neben der Verschiebung, für die Verzerrungen affin und Polynom; ohne Angabe 4 px, in Bildern unter 80 px weniger.</translation>
    </message>
    <message>
      <source>Largest error</source>
      <translation>Größter Fehler</translation>
    </message>
    <message>
      <source>Largest ratio</source>
      <translation>Größtes Verhältnis</translation>
    </message>
    <message>
      <source>Largest ratio of the distances to the nearest and to the next best feature.</source>
      <translation>Größtes Verhältnis der Abstände zum nächsten und zum zweitbesten Merkmal.</translation>
    </message>
    <message>
      <source>Largest rotation</source>
      <translation>Größte Drehung</translation>
    </message>
    <message>
      <source>Largest rotation either way; 180 allows any.</source>
      <translation>Größte Drehung in beiden Richtungen; 180 erlaubt jede.</translation>
    </message>
    <message>
      <source>Largest scale</source>
      <translation>Größter Maßstab</translation>
    </message>
    <message>
      <source>Largest shift; by default 20 pixels of the matching grid, and at most 100.</source>
      <translation>Größte Verschiebung; ohne Angabe 20 Pixel des Vergleichsgitters, und höchstens 100.</translation>
    </message>
    <message>
      <source>Largest side of the piece in the middle of the overlap that is looked at.</source>
      <translation>Größte Seite des Stücks in der Mitte der Überlappung, das betrachtet wird.</translation>
    </message>
    <message>
      <source>Least contrast</source>
      <translation>Geringster Kontrast</translation>
    </message>
    <message>
      <source>Least cover of the terrain model</source>
      <translation>Geringste Abdeckung des Geländemodells</translation>
    </message>
    <message>
      <source>Least length of a reference's pixel in pixels of the input; of georeferenced images, against the nominal one.</source>
      <translation>Geringste Länge eines Pixels der Referenz in Pixeln der Eingabe; bei Bildern mit Georeferenz gegen das Soll.</translation>
    </message>
    <message>
      <source>Lee</source>
      <translation>Lee</translation>
    </message>
    <message>
      <source>Left of the line: the reference. Swipe: move the mouse over the map. Roads and shores must run on over the line.</source>
      <translation>Links der Linie: die Referenz. Wischen: die Maus über die Karte bewegen. Straßen und Ufer müssen über die Linie weiterlaufen.</translation>
    </message>
    <message>
      <source>Left out</source>
      <translation>Weggelassen</translation>
    </message>
    <message>
      <source>Length of the skeleton (m)</source>
      <translation>Länge des Skeletts (m)</translation>
    </message>
    <message>
      <source>Linear</source>
      <translation>Linear</translation>
    </message>
    <message>
      <source>Lines from where a point of the input nominally lies to where it is.</source>
      <translation>Linien von dort, wo ein Punkt der Eingabe nach ihrer Georeferenz liegt, dorthin, wo er ist.</translation>
    </message>
    <message>
      <source>Load an example</source>
      <translation>Beispiel laden</translation>
    </message>
    <message>
      <source>Log</source>
      <translation>Protokoll</translation>
    </message>
    <message>
      <source>Look</source>
      <translation>Ansehen</translation>
    </message>
    <message>
      <source>Looks</source>
      <translation>Looks</translation>
    </message>
    <message>
      <source>MLMI</source>
      <translation>MLMI</translation>
    </message>
    <message>
      <source>Many scenes</source>
      <translation>Viele Szenen</translation>
    </message>
    <message>
      <source>Mask</source>
      <translation>Maske</translation>
    </message>
    <message>
      <source>Mask all of a radar image but homogeneous regions on the ground: roads, waters, squares.</source>
      <translation>Alles von einem Radarbild maskieren außer homogenen Regionen am Boden: Straßen, Gewässern, Plätzen.</translation>
    </message>
    <message>
      <source>Mask all of a radar image of a town but the ground between its buildings.</source>
      <translation>Alles vom Radarbild einer Stadt maskieren außer dem Boden zwischen ihren Gebäuden.</translation>
    </message>
    <message>
      <source>Mask all of an image but the ground that a surface model and the views of images leave.</source>
      <translation>Alles von einem Bild maskieren außer dem Boden, den ein Oberflächenmodell und die Blickrichtungen der Bilder lassen.</translation>
    </message>
    <message>
      <source>Mask by a surface model</source>
      <translation>Maske aus einem Oberflächenmodell</translation>
    </message>
    <message>
      <source>Mask by layover and shadow</source>
      <translation>Maske nach Layover und Schatten</translation>
    </message>
    <message>
      <source>Mask by regions</source>
      <translation>Maske aus Regionen</translation>
    </message>
    <message>
      <source>Mask by thresholds</source>
      <translation>Maske aus Schwellen</translation>
    </message>
    <message>
      <source>Mask of the image</source>
      <translation>Maske des Bildes</translation>
    </message>
    <message>
      <source>Mask of the input</source>
      <translation>Maske der Eingabe</translation>
    </message>
    <message>
      <source>Mask of the reference</source>
      <translation>Maske der Referenz</translation>
    </message>
    <message>
      <source>Mask the strong scatterers of a radar image, as buildings are.</source>
      <translation>Die starken Streuer eines Radarbildes maskieren, wie Gebäude es sind.</translation>
    </message>
    <message>
      <source>Masks all of a radar image but homogeneous ground, and registers an optical image to what is left: for towns, whose walls and roofs lie elsewhere in a radar image.</source>
      <translation>Maskiert alles von einem Radarbild außer homogenem Boden und registriert ein optisches Bild auf das, was bleibt: für Städte, deren Wände und Dächer in einem Radarbild anderswo liegen.</translation>
    </message>
    <message>
      <source>Masks the bright part of a radar image, and registers many dates to what is left.</source>
      <translation>Maskiert den hellen Teil eines Radarbildes und registriert viele Aufnahmen auf das, was bleibt.</translation>
    </message>
    <message>
      <source>Match SAR with SAR</source>
      <translation>SAR mit SAR zuordnen</translation>
    </message>
    <message>
      <source>Match optical images</source>
      <translation>Optische Bilder zuordnen</translation>
    </message>
    <message>
      <source>Matches ground control for an image with RPCs in a reference image, refines the RPCs by it, orthorectifies the image on the reference's pixels, and compares both by eye.</source>
      <translation>Gewinnt Passpunkte für ein Bild mit RPCs aus einem Referenzbild, verbessert damit die RPCs, orthorektifiziert das Bild auf die Pixel der Referenz und vergleicht beide fürs Auge.</translation>
    </message>
    <message>
      <source>Matching</source>
      <translation>Zuordnung</translation>
    </message>
    <message>
      <source>Mean accuracy of both classes</source>
      <translation>Mittlere Genauigkeit beider Klassen</translation>
    </message>
    <message>
      <source>Mean and variance</source>
      <translation>Mittelwert und Varianz</translation>
    </message>
    <message>
      <source>Measure how good a registration is that was made before, by points, consistency and by eye.</source>
      <translation>Messen, wie gut eine frühere Registrierung ist, an Punkten, an der Konsistenz und mit dem Auge.</translation>
    </message>
    <message>
      <source>Measure how well feature detectors and descriptors do on a registered pair.</source>
      <translation>Messen, wie gut Merkmalsdetektoren und Deskriptoren auf einem registrierten Paar sind.</translation>
    </message>
    <message>
      <source>Median error of loops (px)</source>
      <translation>Median des Schleifenfehlers (px)</translation>
    </message>
    <message>
      <source>Model</source>
      <translation>Modell</translation>
    </message>
    <message>
      <source>Model of the bias</source>
      <translation>Modell des systematischen Fehlers</translation>
    </message>
    <message>
      <source>Models</source>
      <translation>Modelle</translation>
    </message>
    <message>
      <source>Move points</source>
      <translation>Punkte verschieben</translation>
    </message>
    <message>
      <source>Mutual information</source>
      <translation>Transinformation</translation>
    </message>
    <message>
      <source>Mutual information and orientation</source>
      <translation>Transinformation und Kantenrichtung</translation>
    </message>
    <message>
      <source>Name of the tool to run.</source>
      <translation>Name des Werkzeugs, das laufen soll.</translation>
    </message>
    <message>
      <source>Nearest</source>
      <translation>Nächster Nachbar</translation>
    </message>
    <message>
      <source>Nelder–Mead</source>
      <translation>Nelder–Mead</translation>
    </message>
    <message>
      <source>Next worst point (N)</source>
      <translation>Nächstschlechtester Punkt (N)</translation>
    </message>
    <message>
      <source>Normalised cross-correlation</source>
      <translation>Normierte Kreuzkorrelation</translation>
    </message>
    <message>
      <source>Normalised mutual information</source>
      <translation>Normierte Transinformation</translation>
    </message>
    <message>
      <source>Not written: {}.</source>
      <translation>Nicht geschrieben: {}.</translation>
    </message>
    <message>
      <source>Nothing is missing: all Python packages that GroundTie needs are there.</source>
      <translation>Nichts fehlt: alle Python-Pakete, die GroundTie braucht, sind da.</translation>
    </message>
    <message>
      <source>Number of check points</source>
      <translation>Zahl der Prüfpunkte</translation>
    </message>
    <message>
      <source>Number of grey levels of the joint histogram; by default 8 to 32, by the size of the window.</source>
      <translation>Zahl der Graustufen des gemeinsamen Histogramms; ohne Angabe 8 bis 32, nach der Größe des Fensters.</translation>
    </message>
    <message>
      <source>Number of looks of the SAR image: fewer are noisier.</source>
      <translation>Zahl der Looks des SAR-Bildes: weniger rauschen mehr.</translation>
    </message>
    <message>
      <source>Number of points that are used</source>
      <translation>Zahl der benutzten Punkte</translation>
    </message>
    <message>
      <source>Number of rows that run at the same time; by default one per processor.</source>
      <translation>Zahl der Zeilen, die gleichzeitig laufen; ohne Angabe eine je Prozessor.</translation>
    </message>
    <message>
      <source>Number of things that are missing</source>
      <translation>Zahl der fehlenden Dinge</translation>
    </message>
    <message>
      <source>Number of tie points</source>
      <translation>Zahl der Verknüpfungspunkte</translation>
    </message>
    <message>
      <source>Numbers</source>
      <translation>Zahlen</translation>
    </message>
    <message>
      <source>Of Rényi's entropy for renyi, of Tsallis' for tsallis; 1 is Shannon's.</source>
      <translation>Der Rényi-Entropie für renyi, der Tsallis-Entropie für tsallis; 1 ist Shannons.</translation>
    </message>
    <message>
      <source>Of enhanced-frost: larger values keep more of edges, and of speckle.</source>
      <translation>Für Enhanced Frost: größere Werte erhalten mehr von den Kanten, und vom Speckle.</translation>
    </message>
    <message>
      <source>Of the support vector machine; polynomial is of degree 3, quadratic of 2.</source>
      <translation>Der Support Vector Machine; Polynom ist vom Grad 3, quadratisch vom Grad 2.</translation>
    </message>
    <message>
      <source>Off-nadir angle</source>
      <translation>Blickwinkel zum Nadir</translation>
    </message>
    <message>
      <source>Open report</source>
      <translation>Bericht öffnen</translation>
    </message>
    <message>
      <source>Optical</source>
      <translation>Optisch</translation>
    </message>
    <message>
      <source>Optical and optical</source>
      <translation>Optisch und optisch</translation>
    </message>
    <message>
      <source>Orbit</source>
      <translation>Umlaufbahn</translation>
    </message>
    <message>
      <source>Order of the B-spline by which pixels enter the joint histogram: 2 is partial volume interpolation, 4 the cubic spline; 4 and more are free of artefacts.</source>
      <translation>Ordnung des B-Splines, mit dem Pixel in das gemeinsame Histogramm eingehen: 2 ist Partial-Volume-Interpolation, 4 der kubische Spline; 4 und mehr sind frei von Artefakten.</translation>
    </message>
    <message>
      <source>Order of the entropy</source>
      <translation>Ordnung der Entropie</translation>
    </message>
    <message>
      <source>Order of the histogram's spline</source>
      <translation>Ordnung des Histogramm-Splines</translation>
    </message>
    <message>
      <source>Orientation</source>
      <translation>Kantenrichtung</translation>
    </message>
    <message>
      <source>Orthoimage</source>
      <translation>Orthobild</translation>
    </message>
    <message>
      <source>Orthorectify</source>
      <translation>Orthorektifizieren</translation>
    </message>
    <message>
      <source>Orthorectify an image by its RPCs and a terrain model.</source>
      <translation>Ein Bild nach seinen RPCs und einem Geländemodell orthorektifizieren.</translation>
    </message>
    <message>
      <source>Other bands…</source>
      <translation>Andere Kanäle…</translation>
    </message>
    <message>
      <source>Output folder</source>
      <translation>Ausgabeordner</translation>
    </message>
    <message>
      <source>Output grid</source>
      <translation>Ausgabegitter</translation>
    </message>
    <message>
      <source>Parameters</source>
      <translation>Parameter</translation>
    </message>
    <message>
      <source>Paths of outputs begin here, and the results of all rows are written here; by default the folder of the table.</source>
      <translation>Hier beginnen die Pfade von Ausgaben, und hierher kommen die Ergebnisse aller Zeilen; ohne Angabe der Ordner der Tabelle.</translation>
    </message>
    <message>
      <source>Peak downwards (px)</source>
      <translation>Gipfel nach unten (px)</translation>
    </message>
    <message>
      <source>Peak to the right (px)</source>
      <translation>Gipfel nach rechts (px)</translation>
    </message>
    <message>
      <source>Peak, its sub-pixel position and covariance, and the second peak.</source>
      <translation>Gipfel, seine Lage unterhalb des Pixels mit Kovarianz, und der zweite Gipfel.</translation>
    </message>
    <message>
      <source>Phase correlation</source>
      <translation>Phasenkorrelation</translation>
    </message>
    <message>
      <source>Picture</source>
      <translation>Bild des Ergebnisses</translation>
    </message>
    <message>
      <source>Pixel size</source>
      <translation>Pixelgröße</translation>
    </message>
    <message>
      <source>Pixel size at which the images are compared; by default that of the coarser image, twice that for a radar image and a terrain model.</source>
      <translation>Pixelgröße, in der die Bilder verglichen werden; ohne Angabe die des gröberen Bildes, bei einem Radarbild und einem Geländemodell das Doppelte.</translation>
    </message>
    <message>
      <source>Pixel size for matching</source>
      <translation>Pixelgröße der Zuordnung</translation>
    </message>
    <message>
      <source>Pixel size of the SAR image.</source>
      <translation>Pixelgröße des SAR-Bildes.</translation>
    </message>
    <message>
      <source>Pixel size of the input</source>
      <translation>Pixelgröße der Eingabe</translation>
    </message>
    <message>
      <source>Pixel size of the optical image; by default that of the SAR image.</source>
      <translation>Pixelgröße des optischen Bildes; ohne Angabe die des SAR-Bildes.</translation>
    </message>
    <message>
      <source>Pixel size of the result, where it does not get the reference's grid.</source>
      <translation>Pixelgröße des Ergebnisses, wo es nicht das Gitter der Referenz bekommt.</translation>
    </message>
    <message>
      <source>Pixel size of the result; by default that of the image on the ground.</source>
      <translation>Pixelgröße des Ergebnisses; ohne Angabe die des Bildes am Boden.</translation>
    </message>
    <message>
      <source>Pixels as the input's</source>
      <translation>Pixel wie die der Eingabe</translation>
    </message>
    <message>
      <source>Point</source>
      <translation>Punkt</translation>
    </message>
    <message>
      <source>Points of extract_gcps or of a person, in place of a reference; also orthority's GeoJSON, a raster or VRT with GCPs of GDAL, and ENVI's .pts.</source>
      <translation>Punkte von extract_gcps oder von einem Menschen, statt einer Referenz; auch GeoJSON von orthority, ein Raster oder VRT mit Passpunkten von GDAL, und ENVIs .pts.</translation>
    </message>
    <message>
      <source>Points that are independent of the refinement. If some have the role check, these alone count.</source>
      <translation>Punkte, die von der Verbesserung unabhängig sind. Haben einige die Rolle check, zählen nur diese.</translation>
    </message>
    <message>
      <source>Points that are independent of the registration: tie points, or a CSV table with the columns reference_x, reference_y and input_col, input_row (or input_x, input_y).</source>
      <translation>Punkte, die von der Registrierung unabhängig sind: Verknüpfungspunkte, oder eine CSV-Tabelle mit den Spalten reference_x, reference_y und input_col, input_row (oder input_x, input_y).</translation>
    </message>
    <message>
      <source>Points with position in the image and on the map, height, covariance and scores; .txt holds options of gdal_translate.</source>
      <translation>Punkte mit Lage im Bild und auf der Karte, Höhe, Kovarianz und Güten; .txt enthält Optionen von gdal_translate.</translation>
    </message>
    <message>
      <source>Points, or polygons around features, with an attribute that gives their class.</source>
      <translation>Punkte, oder Polygone um Merkmale, mit einem Attribut, das ihre Klasse angibt.</translation>
    </message>
    <message>
      <source>Polynomial</source>
      <translation>Polynom</translation>
    </message>
    <message>
      <source>Polynomial of degree 2</source>
      <translation>Polynom zweiten Grades</translation>
    </message>
    <message>
      <source>Polynomial of degree 3</source>
      <translation>Polynom dritten Grades</translation>
    </message>
    <message>
      <source>Powell</source>
      <translation>Powell</translation>
    </message>
    <message>
      <source>Pull a mark to its place on the reference, or a line's other end.</source>
      <translation>Eine Marke an ihre Stelle auf der Referenz ziehen, oder das andere Ende einer Linie.</translation>
    </message>
    <message>
      <source>Python packages are imported and their versions compared with those that are needed; GDAL's formats, PROJ's data and the grids of the geoids EGM96 and EGM2008 are tried. If something is marked as not here, only what its line names cannot run. If something is marked as missing, the exit code is 2. Put these lines into a report of a bug.</source>
      <translation>Python-Pakete werden importiert und ihre Versionen mit den nötigen verglichen; GDALs Formate, PROJs Daten und die Gitter der Geoide EGM96 und EGM2008 werden probiert. Ist etwas als nicht da (not here) bezeichnet, so läuft nur das nicht, was seine Zeile nennt. Ist etwas als fehlend (missing) bezeichnet, so ist der Rückgabewert 2. Diese Zeilen gehören in jede Fehlermeldung.</translation>
    </message>
    <message>
      <source>Python packages are missing: Raster &gt; GroundTie &gt; Install what is missing</source>
      <translation>Python-Pakete fehlen: Raster &gt; GroundTie &gt; Fehlendes installieren</translation>
    </message>
    <message>
      <source>Python was not found: {} cannot be started.</source>
      <translation>Python wurde nicht gefunden: {} lässt sich nicht starten.</translation>
    </message>
    <message>
      <source>Quadratic</source>
      <translation>Quadratisch</translation>
    </message>
    <message>
      <source>Quality</source>
      <translation>Qualität</translation>
    </message>
    <message>
      <source>RPC file</source>
      <translation>RPC-Datei</translation>
    </message>
    <message>
      <source>RPCs of refine_rpc: _RPC.TXT, .RPB, or an image (.tif) that has them.</source>
      <translation>RPCs von refine_rpc: _RPC.TXT, .RPB, oder ein Bild (.tif), das sie hat.</translation>
    </message>
    <message>
      <source>RPCs to use in place of the image's own: _RPC.TXT, .RPB or the RPC XML of DIMAP 2 and 3.</source>
      <translation>RPCs statt derer des Bildes: _RPC.TXT, .RPB oder das RPC-XML von DIMAP 2 und 3.</translation>
    </message>
    <message>
      <source>RPCs: ground control, refined RPCs, orthoimage, assessment</source>
      <translation>RPCs: Passpunkte, verbesserte RPCs, Orthobild, Beurteilung</translation>
    </message>
    <message>
      <source>Radar</source>
      <translation>Radar</translation>
    </message>
    <message>
      <source>Radar image</source>
      <translation>Radarbild</translation>
    </message>
    <message>
      <source>Radar images, a camera's images and pairs of both are matched as match_sar_sar, match_optical and `coregister` do; if that is refused, another way that makes sense is tried, and rotation and scale are searched for. If the input has RPCs, they are refined and the input is orthorectified, with the terrain model if one is given. For other inputs, the terrain model serves to remove displacements by wrong heights, if the points justify that. The result names what was tried, and why; the probability of agreement by chance counts all of it. A refused registration writes no image.</source>
      <translation>Radarbilder, Kamerabilder und Paare aus beiden werden zugeordnet wie von match_sar_sar, match_optical und `coregister`; wird das abgelehnt, wird ein anderer sinnvoller Weg versucht und nach Drehung und Maßstab gesucht. Hat die Eingabe RPCs, werden sie verbessert, und sie wird orthorektifiziert, mit dem Geländemodell, wenn eines angegeben ist. Bei anderen Eingaben dient das Geländemodell dazu, Versatz durch falsche Höhen zu entfernen, wenn die Punkte das rechtfertigen. Das Ergebnis nennt, was versucht wurde und warum; die Wahrscheinlichkeit zufälliger Übereinstimmung zählt alles davon. Eine abgelehnte Registrierung schreibt kein Bild.</translation>
    </message>
    <message>
      <source>Radon</source>
      <translation>Radon</translation>
    </message>
    <message>
      <source>Range of the terrain's heights.</source>
      <translation>Spanne der Geländehöhen.</translation>
    </message>
    <message>
      <source>Reason of the verdict</source>
      <translation>Grund des Urteils</translation>
    </message>
    <message>
      <source>Reasons</source>
      <translation>Gründe</translation>
    </message>
    <message>
      <source>Reference</source>
      <translation>Referenz</translation>
    </message>
    <message>
      <source>Reference image</source>
      <translation>Referenzbild</translation>
    </message>
    <message>
      <source>Refine RPCs</source>
      <translation>RPCs verbessern</translation>
    </message>
    <message>
      <source>Refine the RPCs of an image by ground control, given or matched in a reference image.</source>
      <translation>Die RPCs eines Bildes durch Passpunkte verbessern, angegebene oder in einem Referenzbild gefundene.</translation>
    </message>
    <message>
      <source>Refined RPCs</source>
      <translation>Verbesserte RPCs</translation>
    </message>
    <message>
      <source>Regions</source>
      <translation>Regionen</translation>
    </message>
    <message>
      <source>Register</source>
      <translation>Registrieren</translation>
    </message>
    <message>
      <source>Register a SAR image to another one: other sensor, incidence angle, orbit or date.</source>
      <translation>Ein SAR-Bild auf ein anderes registrieren: anderer Sensor, Einfallswinkel, Umlaufbahn oder Zeitpunkt.</translation>
    </message>
    <message>
      <source>Register an image to another one of the same place; the images decide how.</source>
      <translation>Ein Bild auf ein anderes desselben Ortes registrieren; die Bilder entscheiden, wie.</translation>
    </message>
    <message>
      <source>Register and review…</source>
      <translation>Registrieren und prüfen…</translation>
    </message>
    <message>
      <source>Register images</source>
      <translation>Bilder registrieren</translation>
    </message>
    <message>
      <source>Register optical images to one another: other bands, dates or sensors, day and night.</source>
      <translation>Optische Bilder aufeinander registrieren: andere Kanäle, Zeiten oder Sensoren, Tag und Nacht.</translation>
    </message>
    <message>
      <source>Register the dates of a series to one reference, or to each other.</source>
      <translation>Die Aufnahmen einer Serie auf eine Referenz registrieren, oder aufeinander.</translation>
    </message>
    <message>
      <source>Register two images first.</source>
      <translation>Zuerst zwei Bilder registrieren.</translation>
    </message>
    <message>
      <source>Registered dates, series.csv, series.gpkg and series.json; what it holds of an earlier run with the same files and parameters is not done again.</source>
      <translation>Registrierte Aufnahmen, series.csv, series.gpkg und series.json; was darin von einem früheren Lauf mit denselben Dateien und Parametern steht, wird nicht noch einmal gerechnet.</translation>
    </message>
    <message>
      <source>Registered image</source>
      <translation>Registriertes Bild</translation>
    </message>
    <message>
      <source>Registers a radar image to another one, and applies the same transform to another raster of its scene: another polarisation, the phase, a classification.</source>
      <translation>Registriert ein Radarbild auf ein anderes und wendet dieselbe Transformation auf ein weiteres Raster seiner Szene an: eine andere Polarisation, die Phase, eine Klassifikation.</translation>
    </message>
    <message>
      <source>Registration</source>
      <translation>Registrierung</translation>
    </message>
    <message>
      <source>Relief</source>
      <translation>Relief</translation>
    </message>
    <message>
      <source>Repair</source>
      <translation>Nachbessern</translation>
    </message>
    <message>
      <source>Repeatability and matches by class of overlap error, to look at.</source>
      <translation>Wiederholbarkeit und Zuordnungen nach Klassen des Überlappungsfehlers, zum Ansehen.</translation>
    </message>
    <message>
      <source>Repeatability of detectors</source>
      <translation>Wiederholbarkeit von Detektoren</translation>
    </message>
    <message>
      <source>Report</source>
      <translation>Bericht</translation>
    </message>
    <message>
      <source>Resampling</source>
      <translation>Neuabtastung</translation>
    </message>
    <message>
      <source>Residual (px)</source>
      <translation>Abweichung (px)</translation>
    </message>
    <message>
      <source>Residuals</source>
      <translation>Abweichungen</translation>
    </message>
    <message>
      <source>Resume</source>
      <translation>Fortsetzen</translation>
    </message>
    <message>
      <source>Rigid</source>
      <translation>Starr</translation>
    </message>
    <message>
      <source>Rigid (shift and rotation)</source>
      <translation>Starr (Verschiebung und Drehung)</translation>
    </message>
    <message>
      <source>Role</source>
      <translation>Rolle</translation>
    </message>
    <message>
      <source>Rotation</source>
      <translation>Drehung</translation>
    </message>
    <message>
      <source>Rotation (°)</source>
      <translation>Drehung (°)</translation>
    </message>
    <message>
      <source>Rotation of the optical image, for distortions rotation and similarity; by default 2°.</source>
      <translation>Drehung des optischen Bildes, für die Verzerrungen Drehung und Ähnlichkeit; ohne Angabe 2°.</translation>
    </message>
    <message>
      <source>Rotation steps</source>
      <translation>Drehschritte</translation>
    </message>
    <message>
      <source>Rows run in any order, several at a time, and each one's failure or refusal is its own. A table of results (CSV) and the same as JSON are written at the end. The exit code is that of the worst row: 2 if one failed, else 3 if one was refused, else 0.</source>
      <translation>Zeilen laufen in beliebiger Reihenfolge, mehrere zugleich, und Scheitern oder Ablehnung ist die Sache jeder einzelnen. Am Ende werden eine Ergebnistabelle (CSV) und dasselbe als JSON geschrieben. Der Rückgabewert ist der der schlechtesten Zeile: 2, wenn eine scheiterte, sonst 3, wenn eine abgelehnt wurde, sonst 0.</translation>
    </message>
    <message>
      <source>Rows that are done</source>
      <translation>Erledigte Zeilen</translation>
    </message>
    <message>
      <source>Rows that failed</source>
      <translation>Gescheiterte Zeilen</translation>
    </message>
    <message>
      <source>Rows that were refused</source>
      <translation>Abgelehnte Zeilen</translation>
    </message>
    <message>
      <source>Run a tool over a table</source>
      <translation>Werkzeug über eine Tabelle laufen lassen</translation>
    </message>
    <message>
      <source>Run a tool over the rows of a table.</source>
      <translation>Ein Werkzeug über die Zeilen einer Tabelle laufen lassen.</translation>
    </message>
    <message>
      <source>Rural</source>
      <translation>Ländlich</translation>
    </message>
    <message>
      <source>Rényi</source>
      <translation>Rényi</translation>
    </message>
    <message>
      <source>SAR</source>
      <translation>SAR</translation>
    </message>
    <message>
      <source>SAR and SAR</source>
      <translation>SAR und SAR</translation>
    </message>
    <message>
      <source>SAR and SAR, and another raster of the same scene</source>
      <translation>SAR und SAR, und ein weiteres Raster derselben Szene</translation>
    </message>
    <message>
      <source>SAR and optical</source>
      <translation>SAR und optisch</translation>
    </message>
    <message>
      <source>SAR and optical by the ground alone</source>
      <translation>SAR und optisch, nur nach dem Boden</translation>
    </message>
    <message>
      <source>SPSA</source>
      <translation>SPSA</translation>
    </message>
    <message>
      <source>SPSA of second order</source>
      <translation>SPSA zweiter Ordnung</translation>
    </message>
    <message>
      <source>Sample</source>
      <translation>Stichprobe</translation>
    </message>
    <message>
      <source>Scale</source>
      <translation>Maßstab</translation>
    </message>
    <message>
      <source>Scale of the optical image, for distortions scale and similarity; by default 1.02.</source>
      <translation>Maßstab des optischen Bildes, für die Verzerrungen Maßstab und Ähnlichkeit; ohne Angabe 1,02.</translation>
    </message>
    <message>
      <source>Scheduler</source>
      <translation>Scheduler</translation>
    </message>
    <message>
      <source>Score</source>
      <translation>Güte</translation>
    </message>
    <message>
      <source>Search</source>
      <translation>Suche</translation>
    </message>
    <message>
      <source>Search farther</source>
      <translation>Weiter suchen</translation>
    </message>
    <message>
      <source>Search radius</source>
      <translation>Suchradius</translation>
    </message>
    <message>
      <source>Second peak's share of the height</source>
      <translation>Anteil des zweiten Gipfels an der Höhe</translation>
    </message>
    <message>
      <source>See the centre's x; give both or none.</source>
      <translation>Siehe Mitte x; beide angeben oder keine.</translation>
    </message>
    <message>
      <source>See the smallest scale.</source>
      <translation>Siehe kleinster Maßstab.</translation>
    </message>
    <message>
      <source>Seed</source>
      <translation>Startwert</translation>
    </message>
    <message>
      <source>Seed of random samples: the same seed gives the same result.</source>
      <translation>Startwert der Stichproben: gleicher Startwert, gleiches Ergebnis.</translation>
    </message>
    <message>
      <source>Sensor models</source>
      <translation>Sensormodelle</translation>
    </message>
    <message>
      <source>Share of the buildings that stand in one of the images only: half of them are pulled down after the SAR image, half are new in the optical one.</source>
      <translation>Anteil der Gebäude, die nur in einem der Bilder stehen: die Hälfte davon wird nach dem SAR-Bild abgerissen, die andere ist im optischen neu.</translation>
    </message>
    <message>
      <source>Share of the image whose heights the terrain model must know; where it does not know them, there is no data.</source>
      <translation>Anteil des Bildes, dessen Höhen das Geländemodell kennen muss; wo es sie nicht kennt, sind keine Daten.</translation>
    </message>
    <message>
      <source>Share of the pixels that take part</source>
      <translation>Anteil der teilnehmenden Pixel</translation>
    </message>
    <message>
      <source>Share of the radar image that takes no part because it is dark: radar shadow, but roads and water, too.</source>
      <translation>Anteil des Radarbildes, der nicht teilnimmt, weil er dunkel ist: Radarschatten, aber auch Straßen und Wasser.</translation>
    </message>
    <message>
      <source>Share that takes no part: strong scatterers as walls and corners. Means over 4 × 4 pixels are compared.</source>
      <translation>Anteil, der nicht teilnimmt: starke Streuer wie Wände und Ecken. Verglichen werden Mittel über 4 × 4 Pixel.</translation>
    </message>
    <message>
      <source>Shift</source>
      <translation>Verschiebung</translation>
    </message>
    <message>
      <source>Shift downwards</source>
      <translation>Verschiebung nach unten</translation>
    </message>
    <message>
      <source>Shift that drifts along the rows</source>
      <translation>Verschiebung, die über die Zeilen driftet</translation>
    </message>
    <message>
      <source>Shift to the right</source>
      <translation>Verschiebung nach rechts</translation>
    </message>
    <message>
      <source>Show a measure of similarity at every shift of one window.</source>
      <translation>Ein Ähnlichkeitsmaß bei jeder Verschiebung eines Fensters zeigen.</translation>
    </message>
    <message>
      <source>Shown is the input where its own georeferencing has it: click there.</source>
      <translation>Gezeigt ist die Eingabe, wo ihre eigene Georeferenz sie hat: dort klicken.</translation>
    </message>
    <message>
      <source>Shown is the reference.</source>
      <translation>Gezeigt wird das Referenzbild.</translation>
    </message>
    <message>
      <source>Shown is the reference: click a place that both images have.</source>
      <translation>Gezeigt ist die Referenz: auf eine Stelle klicken, die beide Bilder haben.</translation>
    </message>
    <message>
      <source>Shown is the registered image.</source>
      <translation>Gezeigt wird das registrierte Bild.</translation>
    </message>
    <message>
      <source>Side of the window, an odd number; isef smooths as much as the mean of it.</source>
      <translation>Seite des Fensters, eine ungerade Zahl; ISEF glättet so stark wie das Mittel darüber.</translation>
    </message>
    <message>
      <source>Side of the window, in pixels of the matching grid; even numbers get one more.</source>
      <translation>Seite des Fensters, in Pixeln des Vergleichsgitters; gerade Zahlen bekommen eins mehr.</translation>
    </message>
    <message>
      <source>Similarity</source>
      <translation>Ähnlichkeit</translation>
    </message>
    <message>
      <source>Similarity (shift, rotation, scale)</source>
      <translation>Ähnlichkeit (Verschiebung, Drehung, Maßstab)</translation>
    </message>
    <message>
      <source>Similarity surface</source>
      <translation>Ähnlichkeitsfläche</translation>
    </message>
    <message>
      <source>Simulate a SAR–optical pair</source>
      <translation>SAR-optisches Paar simulieren</translation>
    </message>
    <message>
      <source>Simulate a SAR–optical pair whose misregistration is known exactly.</source>
      <translation>Ein SAR-optisches Paar simulieren, dessen Fehlregistrierung genau bekannt ist.</translation>
    </message>
    <message>
      <source>Simulate a sensor image</source>
      <translation>Sensorbild simulieren</translation>
    </message>
    <message>
      <source>Simulate an optical image in sensor geometry, with RPCs whose errors are known exactly.</source>
      <translation>Ein optisches Bild in Sensorgeometrie simulieren, mit RPCs, deren Fehler genau bekannt sind.</translation>
    </message>
    <message>
      <source>Simulation</source>
      <translation>Simulation</translation>
    </message>
    <message>
      <source>Size</source>
      <translation>Größe</translation>
    </message>
    <message>
      <source>Skeleton</source>
      <translation>Skelett</translation>
    </message>
    <message>
      <source>Skip rows that an earlier run has done or refused, by its log: where input files, parameters, version and outputs are unchanged.</source>
      <translation>Zeilen überspringen, die ein früherer Lauf nach seinem Protokoll erledigt oder abgelehnt hat: wo Eingabedateien, Parameter, Version und Ausgaben unverändert sind.</translation>
    </message>
    <message>
      <source>Slope that one place in a thousand exceeds, of mountains that are rough at all scales; by default, country is gentle.</source>
      <translation>Neigung, die ein Ort von tausend überschreitet, in Bergen, die in allen Größen rau sind; sonst ist das Land sanft.</translation>
    </message>
    <message>
      <source>Smallest scale</source>
      <translation>Kleinster Maßstab</translation>
    </message>
    <message>
      <source>Smooth the speckle of a radar image, and keep its edges.</source>
      <translation>Den Speckle eines Radarbildes glätten und seine Kanten erhalten.</translation>
    </message>
    <message>
      <source>Speckle is filtered, regions grow from homogeneous seeds, and those stay that are long or large and neither bright nor radar shadow. Long ones are thinned to their skeleton and broadened by a window; strong scatterers inside are masked. The mask is for the registration of this image.</source>
      <translation>Der Speckle wird gefiltert, Regionen wachsen aus homogenen Keimen, und es bleiben die, die lang oder groß und weder hell noch Radarschatten sind. Lange werden zu ihrem Skelett verdünnt und um ein Fenster verbreitert; starke Streuer darin werden maskiert. Die Maske ist für die Registrierung dieses Bildes.</translation>
    </message>
    <message>
      <source>Standard deviation of the error, correlated over some 100 pixels, of the heights that the input was orthorectified with.</source>
      <translation>Standardabweichung des über etwa 100 Pixel korrelierten Fehlers der Höhen, mit denen die Eingabe orthorektifiziert wurde.</translation>
    </message>
    <message>
      <source>State what is installed, what is missing, and what cannot run therefore.</source>
      <translation>Angeben, was installiert ist, was fehlt und was darum nicht laufen kann.</translation>
    </message>
    <message>
      <source>Statistics</source>
      <translation>Statistik</translation>
    </message>
    <message>
      <source>Steepest slopes</source>
      <translation>Steilste Hänge</translation>
    </message>
    <message>
      <source>Suburban</source>
      <translation>Vorstädtisch</translation>
    </message>
    <message>
      <source>Surface model</source>
      <translation>Oberflächenmodell</translation>
    </message>
    <message>
      <source>Swipe</source>
      <translation>Wischen</translation>
    </message>
    <message>
      <source>Table</source>
      <translation>Tabelle</translation>
    </message>
    <message>
      <source>Table of results</source>
      <translation>Ergebnistabelle</translation>
    </message>
    <message>
      <source>Terrain model</source>
      <translation>Geländemodell</translation>
    </message>
    <message>
      <source>Terrain model of the input</source>
      <translation>Geländemodell der Eingabe</translation>
    </message>
    <message>
      <source>Texture</source>
      <translation>Textur</translation>
    </message>
    <message>
      <source>The RPCs alone, as _RPC.TXT or .RPB, or a copy of the image (.tif) with them.</source>
      <translation>Die RPCs allein, als _RPC.TXT oder .RPB, oder eine Kopie des Bildes (.tif) mit ihnen.</translation>
    </message>
    <message>
      <source>The band that is looked at, as it will be matched; by default the mean of all bands.</source>
      <translation>Der Kanal, der betrachtet wird, so wie er zugeordnet wird; ohne Angabe das Mittel aller Kanäle.</translation>
    </message>
    <message>
      <source>The band that is looked at; by default the mean of all bands.</source>
      <translation>Der Kanal, der betrachtet wird; ohne Angabe das Mittel aller Kanäle.</translation>
    </message>
    <message>
      <source>The band that is matched, from 1; by default the mean of all bands. Registered images have all bands.</source>
      <translation>Der Kanal, der zugeordnet wird, von 1 an; ohne Angabe das Mittel aller Kanäle. Registrierte Bilder haben alle Kanäle.</translation>
    </message>
    <message>
      <source>The band that is matched; by default the mean of all bands.</source>
      <translation>Der Kanal, der zugeordnet wird; ohne Angabe das Mittel aller Kanäle.</translation>
    </message>
    <message>
      <source>The band that is matched; by default the mean of all bands. A registered image has all bands.</source>
      <translation>Der Kanal, der zugeordnet wird; ohne Angabe das Mittel aller Kanäle. Ein registriertes Bild hat alle Kanäle.</translation>
    </message>
    <message>
      <source>The bias of the RPCs is estimated in the image, by least squares weighted with the points' covariances, without the blunders among them, and folded into new RPCs. They are refused, and nothing is written, if points that took no part are not nearer than before, if these do not agree, or if the points do not determine the model all over the image.</source>
      <translation>Der systematische Fehler der RPCs wird im Bild geschätzt, nach kleinsten Quadraten, gewichtet mit den Kovarianzen der Punkte, ohne die groben Fehler unter ihnen, und in neue RPCs eingerechnet. Sie werden abgelehnt, und nichts wird geschrieben, wenn Punkte, die nicht teilnahmen, nicht näher liegen als vorher, wenn diese nicht übereinstimmen, oder wenn die Punkte das Modell nicht im ganzen Bild halten.</translation>
    </message>
    <message>
      <source>The errors as arrows in the image.</source>
      <translation>Die Fehler als Pfeile im Bild.</translation>
    </message>
    <message>
      <source>The errors of each point.</source>
      <translation>Die Fehler jedes Punktes.</translation>
    </message>
    <message>
      <source>The heights that the input was orthorectified with; by default, one height everywhere. Goes with a terrain model.</source>
      <translation>Die Höhen, mit denen die Eingabe orthorektifiziert wurde; sonst überall eine Höhe. Gehört zu einem Geländemodell.</translation>
    </message>
    <message>
      <source>The image is projected onto the reference's map by its RPCs and matched there as `coregister` does; what is found is carried back into the image. A coarse error of the RPCs within the search radius is found first. Held-out points decide whether the points can be trusted; if not, nothing is written.</source>
      <translation>Das Bild wird nach seinen RPCs auf die Karte der Referenz projiziert und dort zugeordnet wie von `coregister`; was gefunden wird, wird ins Bild zurückgetragen. Ein grober Fehler der RPCs innerhalb des Suchradius wird zuerst gefunden. Zurückgehaltene Punkte entscheiden, ob man den Punkten trauen kann; wenn nicht, wird nichts geschrieben.</translation>
    </message>
    <message>
      <source>The image that was registered, for the report's pictures. It is needed where there is no transform: its georeferencing gives the nominal positions.</source>
      <translation>Das Bild, das registriert wurde, für die Bilder des Berichts. Es wird gebraucht, wo keine Transformation ist: seine Georeferenz gibt die Solllagen.</translation>
    </message>
    <message>
      <source>The image to be registered.</source>
      <translation>Das Bild, das registriert wird.</translation>
    </message>
    <message>
      <source>The image whose features or points are labelled.</source>
      <translation>Das Bild, dessen Merkmale oder Punkte Klassen haben.</translation>
    </message>
    <message>
      <source>The image whose georeferencing is right.</source>
      <translation>Das Bild, dessen Georeferenz stimmt.</translation>
    </message>
    <message>
      <source>The image whose georeferencing is right: for the report's pictures, and for the verdict, as test points were searched for in windows of the coarser image's pixels.</source>
      <translation>Das Bild, dessen Georeferenz stimmt: für die Bilder des Berichts und für das Urteil, denn Testpunkte wurden in Fenstern aus Pixeln des gröberen Bildes gesucht.</translation>
    </message>
    <message>
      <source>The image whose georeferencing is right; without one the mean displacement of all dates is zero.</source>
      <translation>Das Bild, dessen Georeferenz stimmt; ohne eines ist der mittlere Versatz aller Aufnahmen null.</translation>
    </message>
    <message>
      <source>The image, above all a SAR one, whose georeferencing is right: ground control is matched in it.</source>
      <translation>Das Bild, vor allem ein SAR-Bild, dessen Georeferenz stimmt: in ihm werden Passpunkte gefunden.</translation>
    </message>
    <message>
      <source>The input's pixels are resampled once, by the whole transform. Images without georeferencing are matched in pixel coordinates; distances are then in pixels.</source>
      <translation>Die Pixel der Eingabe werden einmal neu abgetastet, durch die ganze Transformation. Bilder ohne Georeferenz werden in Pixelkoordinaten zugeordnet; Entfernungen sind dann in Pixeln.</translation>
    </message>
    <message>
      <source>The layer's attribute that gives the class.</source>
      <translation>Das Attribut des Layers, das die Klasse angibt.</translation>
    </message>
    <message>
      <source>The map as it is drawn</source>
      <translation>Die Karte, wie sie gezeichnet ist</translation>
    </message>
    <message>
      <source>The packages were not installed; pip's reason stands below.</source>
      <translation>Die Pakete wurden nicht installiert; pips Grund steht unten.</translation>
    </message>
    <message>
      <source>The points of the registration: those with the role fit are control points, those with the role check are test points.</source>
      <translation>Die Punkte der Registrierung: die mit der Rolle fit sind Ausgleichspunkte, die mit der Rolle check Testpunkte.</translation>
    </message>
    <message>
      <source>The points with lines from where the refined RPCs see them on the map to where they are.</source>
      <translation>Die Punkte mit Linien von dort, wo die verbesserten RPCs sie auf der Karte sehen, dorthin, wo sie sind.</translation>
    </message>
    <message>
      <source>The raster may be the one that was registered, or another one of the same scene: other bands, another pixel size, another date on the same grid. Rasters with georeferencing are located by it; a raster without it must have the size of the one that was registered. All bands are resampled once, from the original pixels. Tie points are fitted as they are: those that are marked as rejected or as check points are left out.</source>
      <translation>Das Raster kann das registrierte sein oder ein anderes derselben Szene: andere Kanäle, eine andere Pixelgröße, ein anderer Zeitpunkt auf demselben Gitter. Raster mit Georeferenz werden nach ihr gelegt; ein Raster ohne sie muss die Größe des registrierten haben. Alle Kanäle werden einmal neu abgetastet, aus den ursprünglichen Pixeln. Verknüpfungspunkte werden ausgeglichen, wie sie sind: die als verworfen oder als Prüfpunkte bezeichneten bleiben weg.</translation>
    </message>
    <message>
      <source>The reference's pixels</source>
      <translation>Die Pixel der Referenz</translation>
    </message>
    <message>
      <source>The registration is refused if its root mean square error at check points (without any, at test points) is larger, or that of a consistency. By default there is no verdict.</source>
      <translation>Die Registrierung wird abgelehnt, wenn ihr mittlerer quadratischer Fehler an Prüfpunkten (ohne sie an Testpunkten) größer ist, oder der einer Konsistenz. Ohne Angabe gibt es kein Urteil.</translation>
    </message>
    <message>
      <source>The registration is refused if its root mean square error at check points, which take no part in the fit, is larger.</source>
      <translation>Die Registrierung wird abgelehnt, wenn ihr mittlerer quadratischer Fehler an Prüfpunkten, die nicht am Ausgleich teilnehmen, größer ist.</translation>
    </message>
    <message>
      <source>The registration of the reference to the input, for two-way consistency.</source>
      <translation>Die Registrierung der Referenz auf die Eingabe, für die Konsistenz hin und zurück.</translation>
    </message>
    <message>
      <source>The registration, from reference to input. Without it the input's own georeferencing is believed.</source>
      <translation>Die Registrierung, von der Referenz zur Eingabe. Ohne sie wird der eigenen Georeferenz der Eingabe geglaubt.</translation>
    </message>
    <message>
      <source>The registration: a transform from reference to input. Without it, it is fitted to the tie points; without these, the input's own georeferencing is measured.</source>
      <translation>Die Registrierung: eine Transformation von der Referenz zur Eingabe. Ohne sie wird sie an die Verknüpfungspunkte angepasst; ohne diese wird die eigene Georeferenz der Eingabe gemessen.</translation>
    </message>
    <message>
      <source>The result gets exactly the grid of this raster, so that the two stack. By default the result covers all of the image.</source>
      <translation>Das Ergebnis bekommt genau das Gitter dieses Rasters, so dass beide aufeinanderliegen. Ohne Angabe deckt das Ergebnis das ganze Bild.</translation>
    </message>
    <message>
      <source>The result gets exactly the grid of this raster, so that the two stack. By default the result covers all of the input with pixels of the input's size.</source>
      <translation>Das Ergebnis bekommt genau das Gitter dieses Rasters, so dass beide aufeinanderliegen. Ohne Angabe deckt das Ergebnis die ganze Eingabe mit Pixeln von ihrer Größe.</translation>
    </message>
    <message>
      <source>The same as the table, as JSON.</source>
      <translation>Dasselbe wie die Tabelle, als JSON.</translation>
    </message>
    <message>
      <source>The scene has terrain, fields, roads, water and buildings. The SAR image has layover, shadow, double bounce and speckle; the optical one relief displacement, cast shadows and noise. The input may be orthorectified with wrong heights. The same seed gives the same pair. The file truth.json is a transform like those of `coregister`.</source>
      <translation>Die Szene hat Gelände, Felder, Straßen, Wasser und Gebäude. Das SAR-Bild hat Layover, Schatten, Doppelreflexion und Speckle; das optische Reliefversatz, Schlagschatten und Rauschen. Die Eingabe darf mit falschen Höhen orthorektifiziert sein. Derselbe Startwert gibt dasselbe Paar. Die Datei truth.json ist eine Transformation wie die von `coregister`.</translation>
    </message>
    <message>
      <source>The surface has one distinct peak if the measure is fit for the images. Nothing is registered and no verdict given.</source>
      <translation>Die Fläche hat einen deutlichen Gipfel, wenn das Maß für die Bilder taugt. Nichts wird registriert und kein Urteil gegeben.</translation>
    </message>
    <message>
      <source>The surface with its peaks, to look at.</source>
      <translation>Die Fläche mit ihren Gipfeln, zum Ansehen.</translation>
    </message>
    <message>
      <source>The thresholds are percentiles of the means over blocks of 4 × 4 pixels; whole blocks take part or do not. The mask is for the registration of this image.</source>
      <translation>Die Schwellen sind Perzentile der Mittel über Blöcke von 4 × 4 Pixeln; ganze Blöcke nehmen teil oder nicht. Die Maske ist für die Registrierung dieses Bildes.</translation>
    </message>
    <message>
      <source>The transform, for the tool warp or a script.</source>
      <translation>Die Transformation, für das Werkzeug warp oder ein Skript.</translation>
    </message>
    <message>
      <source>There are no points yet. Add a point by a click in each image; three are needed.</source>
      <translation>Es gibt noch keine Punkte. Mit einem Klick in jedem Bild einen Punkt hinzufügen; drei werden gebraucht.</translation>
    </message>
    <message>
      <source>Thin-plate spline</source>
      <translation>Thin-Plate-Spline</translation>
    </message>
    <message>
      <source>Three-way consistency (px)</source>
      <translation>Konsistenz über drei Wege (px)</translation>
    </message>
    <message>
      <source>Tie points</source>
      <translation>Verknüpfungspunkte</translation>
    </message>
    <message>
      <source>Tool</source>
      <translation>Werkzeug</translation>
    </message>
    <message>
      <source>Top left</source>
      <translation>Oben links</translation>
    </message>
    <message>
      <source>Top right</source>
      <translation>Oben rechts</translation>
    </message>
    <message>
      <source>Train a classifier that keeps features on clouds, shadows or changes out of the matching.</source>
      <translation>Einen Klassifikator trainieren, der Merkmale auf Wolken, Schatten oder Veränderungen von der Zuordnung ausnimmt.</translation>
    </message>
    <message>
      <source>Train a feature classifier</source>
      <translation>Merkmalsklassifikator trainieren</translation>
    </message>
    <message>
      <source>Transform</source>
      <translation>Transformation</translation>
    </message>
    <message>
      <source>Transform back</source>
      <translation>Transformation zurück</translation>
    </message>
    <message>
      <source>Transform closing</source>
      <translation>Schließende Transformation</translation>
    </message>
    <message>
      <source>Transform direct</source>
      <translation>Direkte Transformation</translation>
    </message>
    <message>
      <source>Transform onward</source>
      <translation>Weiterführende Transformation</translation>
    </message>
    <message>
      <source>Transform or tie points</source>
      <translation>Transformation oder Verknüpfungspunkte</translation>
    </message>
    <message>
      <source>Translation (shift alone)</source>
      <translation>Translation (nur Verschiebung)</translation>
    </message>
    <message>
      <source>Tsallis</source>
      <translation>Tsallis</translation>
    </message>
    <message>
      <source>Two-way consistency (px)</source>
      <translation>Konsistenz hin und zurück (px)</translation>
    </message>
    <message>
      <source>Undo</source>
      <translation>Rückgängig</translation>
    </message>
    <message>
      <source>Unit of the pixels. Decibels must be made linear before.</source>
      <translation>Einheit der Pixel. Dezibel müssen vorher linear gemacht werden.</translation>
    </message>
    <message>
      <source>Urban</source>
      <translation>Städtisch</translation>
    </message>
    <message>
      <source>Use</source>
      <translation>Nutzen</translation>
    </message>
    <message>
      <source>Values</source>
      <translation>Werte</translation>
    </message>
    <message>
      <source>Values of the attribute or of the raster, separated by commas, whose features are to be left out; those of all other values are kept.</source>
      <translation>Werte des Attributs oder des Rasters, durch Kommas getrennt, deren Merkmale wegbleiben; die aller anderen Werte bleiben.</translation>
    </message>
    <message>
      <source>Values of the masks</source>
      <translation>Werte der Masken</translation>
    </message>
    <message>
      <source>Values of the reference's mask</source>
      <translation>Werte der Maske der Referenz</translation>
    </message>
    <message>
      <source>Variants</source>
      <translation>Varianten</translation>
    </message>
    <message>
      <source>Vertical datum</source>
      <translation>Höhenbezug</translation>
    </message>
    <message>
      <source>View</source>
      <translation>Blickrichtung</translation>
    </message>
    <message>
      <source>View azimuth</source>
      <translation>Blickazimut</translation>
    </message>
    <message>
      <source>Views</source>
      <translation>Blickrichtungen</translation>
    </message>
    <message>
      <source>Warp</source>
      <translation>Verbiegung</translation>
    </message>
    <message>
      <source>Warp a raster</source>
      <translation>Raster entzerren</translation>
    </message>
    <message>
      <source>Weaker features are left out: a share of the range of grey values, as OpenCV counts it; by default as fits each detector.</source>
      <translation>Schwächere Merkmale bleiben weg: ein Anteil der Spanne der Grauwerte, wie OpenCV ihn zählt; ohne Angabe, wie es jedem Detektor passt.</translation>
    </message>
    <message>
      <source>What is compared, separated by commas: each a detector (sift, sift-oct, sift-isef-oct), and if need be a gradient (differences, recursive, roewa, roewa-unsigned) and oriented for descriptors that turn with the image, joined by +.</source>
      <translation>Was verglichen wird, durch Kommas getrennt: je ein Detektor (sift, sift-oct, sift-isef-oct) und, wenn nötig, ein Gradient (differences, recursive, roewa, roewa-unsigned) und oriented für Deskriptoren, die sich mit dem Bild drehen, mit + verbunden.</translation>
    </message>
    <message>
      <source>What is compared; auto takes what fits the search: mutual information where it climbs, else the orientation of edges. The search rotation-steps always takes the latter; ncc compares grey values.</source>
      <translation>Was verglichen wird; Automatisch nimmt, was zur Suche passt: Transinformation, wo sie steigt, sonst die Richtung der Kanten. Drehschritte nehmen immer letztere; die Kreuzkorrelation vergleicht Grauwerte.</translation>
    </message>
    <message>
      <source>What is fitted to tie points where there is no transform; affine by default.</source>
      <translation>Was an Verknüpfungspunkte angepasst wird, wo keine Transformation ist; ohne Angabe affin.</translation>
    </message>
    <message>
      <source>What is fitted to tie points, affine by default; a stored transform has a model already.</source>
      <translation>Was an Verknüpfungspunkte angepasst wird, ohne Angabe affin; eine gespeicherte Transformation hat schon ein Modell.</translation>
    </message>
    <message>
      <source>What is installed</source>
      <translation>Was installiert ist</translation>
    </message>
    <message>
      <source>What is looked at in the 41 × 41 pixels around a feature: mean and variance of the grey values, these with the shares of all bands in their sum (band-ratios: clouds have no colour), or with skewness, gradients and fine detail (texture).</source>
      <translation>Was in den 41 × 41 Pixeln um ein Merkmal betrachtet wird: Mittelwert und Varianz der Grauwerte, diese mit den Anteilen aller Kanäle an ihrer Summe (Kanalverhältnisse: Wolken haben keine Farbe), oder mit Schiefe, Gradienten und feinem Detail (Textur).</translation>
    </message>
    <message>
      <source>What is measured: fused (nmi and orientation), mutual information normalised (nmi) or not (mi), by Rényi's or Tsallis' entropy or by a density ratio (mlmi), the orientation of edges, correlation of grey values (ncc), cluster reward or correlation ratio.</source>
      <translation>Was gemessen wird: Transinformation und Kantenrichtung gemeinsam, Transinformation normiert oder nicht, nach Rényis oder Tsallis' Entropie oder durch ein Dichteverhältnis (MLMI), die Richtung der Kanten, Korrelation der Grauwerte, Cluster Reward oder Korrelationsverhältnis.</translation>
    </message>
    <message>
      <source>What is taken out in the image: a shift, a shift that drifts along the rows, or an affine change; auto takes the simplest that the points justify and carry.</source>
      <translation>Was im Bild herausgenommen wird: eine Verschiebung, eine Verschiebung, die über die Zeilen driftet, oder eine affine Änderung; Automatisch nimmt das Einfachste, das die Punkte begründen und tragen.</translation>
    </message>
    <message>
      <source>What is wrong with the georeferencing of the optical image, besides its shift.</source>
      <translation>Was an der Georeferenz des optischen Bildes falsch ist, neben der Verschiebung.</translation>
    </message>
    <message>
      <source>What lies within this distance of masked pixels takes no part either.</source>
      <translation>Was innerhalb dieser Entfernung von maskierten Pixeln liegt, nimmt auch nicht teil.</translation>
    </message>
    <message>
      <source>What of a mask takes no part: values as 3,8-10; scl, qa-pixel, fmask, hls-fmask or udm2 for clouds and their shadows in these missions' masks; inside for a vector layer of what takes no part. By default 0, and what lies outside of a layer. Without a mask one is taken that lies beside the image by the mission's names; none takes none.</source>
      <translation>Was von einer Maske nicht teilnimmt: Werte wie 3,8-10; scl, qa-pixel, fmask, hls-fmask oder udm2 für Wolken und ihre Schatten in den Masken dieser Missionen; inside für einen Vektorlayer dessen, was nicht teilnimmt. Ohne Angabe 0, und was außerhalb eines Layers liegt. Ohne Maske wird eine genommen, die unter den Namen der Mission neben dem Bild liegt; none nimmt keine.</translation>
    </message>
    <message>
      <source>What of a mask takes no part: values as 3,8-10; scl, qa-pixel, fmask, hls-fmask or udm2 for clouds and their shadows in these missions' masks; inside for a vector layer of what takes no part. By default 0, and what lies outside of a layer. Without a mask one is taken that lies beside the image by the mission's names; none takes none. With two masks that differ, those of the reference first, as in '1; scl'.</source>
      <translation>Was von einer Maske nicht teilnimmt: Werte wie 3,8-10; scl, qa-pixel, fmask, hls-fmask oder udm2 für Wolken und ihre Schatten in den Masken dieser Missionen; inside für einen Vektorlayer dessen, was nicht teilnimmt. Ohne Angabe 0, und was außerhalb eines Layers liegt. Ohne Maske wird eine genommen, die unter den Namen der Mission neben dem Bild liegt; none nimmt keine. Bei zwei verschiedenen Masken zuerst die der Referenz, wie in '1; scl'.</translation>
    </message>
    <message>
      <source>What the heights of the terrain model count from: the ellipsoid, as RPCs do, or a geoid (SRTM: EGM96; Copernicus: EGM2008). Taking one for the other moves heights by up to 100 m.</source>
      <translation>Wovon die Höhen des Geländemodells zählen: vom Ellipsoid, wie bei RPCs, oder von einem Geoid (SRTM: EGM96; Copernicus: EGM2008). Eines für das andere zu nehmen verschiebt Höhen um bis zu 100 m.</translation>
    </message>
    <message>
      <source>What was measured, a row for each variant.</source>
      <translation>Was gemessen wurde, je Variante eine Zeile.</translation>
    </message>
    <message>
      <source>Whatever the search, its pose is accepted only if an exhaustive search over all rotations finds it, too, and nothing nearly as good elsewhere, and if pieces all over the images match there, each by itself.</source>
      <translation>Was auch die Suche ist: ihre Lage wird nur angenommen, wenn eine vollständige Suche über alle Drehungen sie auch findet und anderswo nichts annähernd so Gutes, und wenn Stücke überall in den Bildern dort passen, jedes für sich.</translation>
    </message>
    <message>
      <source>Where the camera is, seen from the ground, clockwise from north.</source>
      <translation>Wo die Kamera steht, vom Boden gesehen, im Uhrzeigersinn von Norden.</translation>
    </message>
    <message>
      <source>Where the satellite with the camera flies to, clockwise from north.</source>
      <translation>Wohin der Satellit mit der Kamera fliegt, im Uhrzeigersinn von Norden.</translation>
    </message>
    <message>
      <source>Where the window's centre lies, in the CRS of the reference; by default the middle of the overlap.</source>
      <translation>Wo die Mitte des Fensters liegt, im KBS der Referenz; ohne Angabe in der Mitte der Überlappung.</translation>
    </message>
    <message>
      <source>Whether grey levels hold equally many pixels, are equally wide, or are all grey values that there are (slow).</source>
      <translation>Ob Graustufen gleich viele Pixel enthalten, gleich breit sind, oder alle vorkommenden Grauwerte sind (langsam).</translation>
    </message>
    <message>
      <source>Whether nearest features are found approximately by k-d trees, or exactly.</source>
      <translation>Ob nächste Merkmale näherungsweise mit k-d-Bäumen gefunden werden oder exakt.</translation>
    </message>
    <message>
      <source>Which asset of STAC items is meant; by default the only one that is a raster.</source>
      <translation>Welches Asset von STAC-Items gemeint ist; ohne Angabe das einzige, das ein Raster ist.</translation>
    </message>
    <message>
      <source>Which image has the wrong georeferencing; the other one is the reference.</source>
      <translation>Welches Bild die falsche Georeferenzierung hat; das andere ist die Referenz.</translation>
    </message>
    <message>
      <source>Which misregistration is taken out of each date; auto takes for each pair the simplest that the points justify.</source>
      <translation>Welche Fehlregistrierung jeder Aufnahme herausgenommen wird; Automatisch nimmt für jedes Paar die einfachste, die die Punkte begründen.</translation>
    </message>
    <message>
      <source>Which misregistration is taken out; auto takes the simplest model that the points justify.</source>
      <translation>Welche Fehlregistrierung herausgenommen wird; Automatisch nimmt das einfachste Modell, das die Punkte begründen.</translation>
    </message>
    <message>
      <source>Width and height of the scene.</source>
      <translation>Breite und Höhe der Szene.</translation>
    </message>
    <message>
      <source>Width of lines</source>
      <translation>Breite von Linien</translation>
    </message>
    <message>
      <source>Width of the result in pixels</source>
      <translation>Breite des Ergebnisses in Pixeln</translation>
    </message>
    <message>
      <source>Window</source>
      <translation>Fenster</translation>
    </message>
    <message>
      <source>Window by which skeletons of long regions are broadened.</source>
      <translation>Fenster, um das Skelette langer Regionen verbreitert werden.</translation>
    </message>
    <message>
      <source>With a terrain model, what wrong heights displace the input by is taken out, too.</source>
      <translation>Mit einem Geländemodell wird auch herausgenommen, worum falsche Höhen die Eingabe versetzen.</translation>
    </message>
    <message>
      <source>Workers</source>
      <translation>Threads</translation>
    </message>
    <message>
      <source>Write image</source>
      <translation>Bild schreiben</translation>
    </message>
    <message>
      <source>Written: {}.</source>
      <translation>Geschrieben: {}.</translation>
    </message>
    <message>
      <source>cancelled; nothing was written</source>
      <translation>abgebrochen; nichts wurde geschrieben</translation>
    </message>
    <message>
      <source>check</source>
      <translation>Prüfung</translation>
    </message>
    <message>
      <source>enhanced-frost, lee, kuan and gamma-map adapt to how much the image varies locally; isef smooths everything alike.</source>
      <translation>Enhanced Frost, Lee, Kuan und Gamma MAP passen sich daran an, wie sehr das Bild örtlich schwankt; ISEF glättet alles gleich.</translation>
    </message>
    <message>
      <source>fit</source>
      <translation>Ausgleich</translation>
    </message>
    <message>
      <source>k-d tree (approximate)</source>
      <translation>k-d-Baum (näherungsweise)</translation>
    </message>
    <message>
      <source>refine clicks by similarity</source>
      <translation>Klicks nach Ähnlichkeit verfeinern</translation>
    </message>
    <message>
      <source>rotation unknown</source>
      <translation>Drehung unbekannt</translation>
    </message>
    <message>
      <source>usual</source>
      <translation>üblich</translation>
    </message>
    <message>
      <source>{agree} of {all} check points agree within {limit} px</source>
      <translation>{agree} von {all} Prüfpunkten stimmen auf {limit} px überein</translation>
    </message>
    <message>
      <source>{model}: left-out error {error}</source>
      <translation>{model}: Fehler weggelassener Punkte {error}</translation>
    </message>
    <message>
      <source>{used} of {all} points take part</source>
      <translation>{used} von {all} Punkten nehmen teil</translation>
    </message>
    <message>
      <source>{} files</source>
      <translation>{}-Dateien</translation>
    </message>
    <message>
      <source>{} is missing</source>
      <translation>{} fehlt</translation>
    </message>
    <message>
      <source>{} set by hand</source>
      <translation>{} von Hand gesetzt</translation>
    </message>
    <message>
      <source>{}: refused</source>
      <translation>{}: abgelehnt</translation>
    </message>
    <message>
      <source>✔ Accepted</source>
      <translation>✔ Angenommen</translation>
    </message>
    <message>
      <source>✘ Not registered</source>
      <translation>✘ Nicht registriert</translation>
    </message>
  </context>
</TS>
